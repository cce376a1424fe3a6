// Images as bytes for the bus and for stores: JPEG or PNG colour, lossless depth.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace vantage::rgbd {

using Bytes = std::vector<std::uint8_t>;

// Larger images are refused by the decoders before any memory is asked for: the bytes come from outside.
constexpr int kMaxImageSide_px = 8192;

// JPEG. bgr is CV_8UC3 and not empty; quality in 1..100. Throws std::invalid_argument otherwise. About 4 ms for 640x480.
Bytes EncodeColor(const cv::Mat& bgr, int quality = 85);

// PNG: lossless, some ten times larger and slower. Throws like EncodeColor.
Bytes EncodeColorLossless(const cv::Mat& bgr);

// The CV_8UC3 image (BGR) of a JPEG or PNG. Throws std::runtime_error: neither, cut off, larger than kMaxImageSide_px.
cv::Mat DecodeColor(const Bytes& bytes);

// Lossless, after RVL (A. D. Wilson, "Fast lossless depth image compression", 2017): runs of no depth, runs of depth, and in those
// the differences of neighbours, all as numbers of as many 4-bit pieces as they need. Fast, as nothing is modelled: 3 to 9 times
// smaller. The layout is this library's own: "RVL1", width and height (uint32, little endian), then the pieces, high half of a byte
// first.
//
// depth is CV_16UC1 and not empty, else std::invalid_argument. About 2 ms for 640x480.
Bytes EncodeDepth(const cv::Mat& depth);

// Throws std::runtime_error where the bytes are not exactly what EncodeDepth makes of some image: another format, cut off, too
// long, sizes out of range, runs past the end, depths out of range. Never reads out of bounds.
cv::Mat DecodeDepth(const Bytes& bytes);

}  // namespace vantage::rgbd
