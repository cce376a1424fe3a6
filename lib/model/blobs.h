// How the store's columns hold images, features, points and poses: little-endian bytes, each with a checksum at its end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "model/object_model.h"

namespace vantage::model {

// FNV-1a, 64 bit. `hash` is the checksum of the bytes before these, so that a stream can be summed up piece by piece.
std::uint64_t Checksum(const char* bytes, std::size_t count, std::uint64_t hash = 14695981039346656037ull);

// Bytes followed by their 8-byte checksum. Decoders throw std::runtime_error in a few words ("3 bytes are no
// image") where a blob is short, damaged or not what its name says; callers add object and view.
using Blob = std::string;

// PNG, lossless: CV_8UC1, CV_8UC3 or CV_16UC1. An empty image is an empty blob.
Blob EncodeImage(const cv::Mat& image);
cv::Mat DecodeImage(const Blob& blob, int type);

Blob EncodeKeypoints(const std::vector<cv::KeyPoint>& keypoints);
std::vector<cv::KeyPoint> DecodeKeypoints(const Blob& blob);

// CV_32F rows.
Blob EncodeDescriptors(const cv::Mat& descriptors);
cv::Mat DecodeDescriptors(const Blob& blob, int rows);

Blob EncodeIndices(const std::vector<int>& indices);
std::vector<int> DecodeIndices(const Blob& blob);

Blob EncodePoints(const std::vector<ModelPoint>& points);
std::vector<ModelPoint> DecodePoints(const Blob& blob);

// All 16 elements, row-major.
Blob EncodeRigid(const geometry::Rigid& transform);
geometry::Rigid DecodeRigid(const Blob& blob);

// width, height, fx, fy, cx, cy.
Blob EncodeCamera(const geometry::PinholeCamera& camera);
geometry::PinholeCamera DecodeCamera(const Blob& blob);

}  // namespace vantage::model
