#include "rgbd/codec.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

#include "rgbd/bop.h"
#include "support/data.h"

namespace vantage::rgbd {
namespace {

// Slopes, steps and holes, with a little noise.
cv::Mat SomeDepth(int width, int height, unsigned seed) {
  std::mt19937 generator(seed);
  cv::Mat depth(height, width, CV_16UC1);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const unsigned value = (x / 50 + y / 40) % 2 ? 700 + x + generator() % 4 : 1500 + 2 * y;
      depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(generator() % 20 == 0 ? 0 : value);
    }
  return depth;
}

bool Same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0.0;
}

TEST(DepthCodec, ComesBackExactly) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(7, 3), cv::Size(320, 240)})
    EXPECT_TRUE(Same(DecodeDepth(EncodeDepth(SomeDepth(size.width, size.height, 1))), SomeDepth(size.width, size.height, 1)));
  EXPECT_TRUE(Same(DecodeDepth(EncodeDepth(cv::Mat::zeros(480, 640, CV_16UC1))), cv::Mat::zeros(480, 640, CV_16UC1)));
  EXPECT_LT(EncodeDepth(cv::Mat::zeros(480, 640, CV_16UC1)).size(), 20u);
  const cv::Mat part = SomeDepth(64, 48, 2)(cv::Rect(5, 6, 30, 20));  // Rows that do not follow each other in memory.
  EXPECT_TRUE(Same(DecodeDepth(EncodeDepth(part)), part));
}

TEST(DepthCodec, ExtremesComeBackExactly) {
  std::mt19937 generator(3);
  cv::Mat depth(40, 50, CV_16UC1);
  for (int i = 0; i < 2000; ++i) {
    const std::uint16_t values[] = {0, 1, 65535, 32768, static_cast<std::uint16_t>(generator())};
    depth.at<std::uint16_t>(i / 50, i % 50) = values[generator() % 5];
  }
  EXPECT_TRUE(Same(DecodeDepth(EncodeDepth(depth)), depth));
}

TEST(DepthCodec, EveryTruncationIsRefused) {
  const Bytes whole = EncodeDepth(SomeDepth(40, 30, 4));
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_THROW(DecodeDepth(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size))), std::runtime_error)
        << size << " of " << whole.size() << " bytes";
  Bytes longer = whole;
  longer.push_back(0);
  EXPECT_THROW(DecodeDepth(longer), std::runtime_error);
}

TEST(DepthCodec, BytesChangedAtWillEitherDecodeOrAreRefused) {
  const Bytes whole = EncodeDepth(SomeDepth(40, 30, 5));
  std::mt19937 generator(6);
  int refused = 0;
  for (int i = 0; i < 20000; ++i) {
    Bytes hostile = whole;
    for (unsigned k = 0; k <= generator() % 4; ++k)
      hostile[generator() % (i % 2 ? 24 : hostile.size())] = static_cast<std::uint8_t>(generator());
    // Sizes of many megapixels are legal and slow; the decoder's own limit is tested below.
    if (hostile[6] || hostile[7] || hostile[10] || hostile[11] || hostile[5] > 2 || hostile[9] > 2) continue;
    try {
      const cv::Mat image = DecodeDepth(hostile);
      EXPECT_EQ(image.type(), CV_16UC1);
    } catch (const std::runtime_error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 1000);
}

TEST(DepthCodec, AbsurdSizesAndWrongImagesAreRefused) {
  Bytes bytes = EncodeDepth(SomeDepth(8, 8, 7));
  for (const std::size_t at : {7u, 11u, 6u}) {
    Bytes hostile = bytes;
    hostile[at] = 0x7F;
    EXPECT_THROW(DecodeDepth(hostile), std::runtime_error);
  }
  Bytes none = bytes;
  none[4] = 0;
  EXPECT_THROW(DecodeDepth(none), std::runtime_error);
  EXPECT_THROW(EncodeDepth(cv::Mat()), std::invalid_argument);
  EXPECT_THROW(EncodeDepth(cv::Mat::zeros(4, 4, CV_8UC1)), std::invalid_argument);
}

TEST(DepthCodec, RealFramesComeBackExactlyAndSmaller) {
  for (const char* name : {"shelf_box", "osd", "ycbv", "board"}) {
    VANTAGE_NEEDS_DATA(name);
    const BopScene scene(testing::DataFolder() / name);
    for (const int id : {scene.ids().front(), scene.ids().back()}) {
      const cv::Mat depth = scene.Load(id).depth;
      const Bytes bytes = EncodeDepth(depth);
      EXPECT_TRUE(Same(DecodeDepth(bytes), depth)) << name << " " << id;
      EXPECT_LT(static_cast<double>(bytes.size()), 2.0 * static_cast<double>(depth.total()) / 3.0) << name << " " << id;
    }
  }
}

TEST(ColorCodec, IsCloseAtTheUsualQualityAndSmallerAtALower) {
  cv::Mat image(120, 160, CV_8UC3);
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x)
      image.at<cv::Vec3b>(y, x) = cv::Vec3b(static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(2 * y), 128);
  const Bytes bytes = EncodeColor(image);
  const cv::Mat again = DecodeColor(bytes);
  ASSERT_EQ(again.size(), image.size());
  EXPECT_LT(cv::norm(image, again, cv::NORM_L1) / static_cast<double>(image.total() * 3), 3.0);
  EXPECT_LT(EncodeColor(image, 30).size(), bytes.size());
  EXPECT_EQ(cv::norm(image, DecodeColor(EncodeColorLossless(image)), cv::NORM_INF), 0.0);
  EXPECT_THROW(EncodeColor(image, 0), std::invalid_argument);
  EXPECT_THROW(EncodeColor(cv::Mat::zeros(3, 3, CV_8UC1)), std::invalid_argument);
}

TEST(ColorCodec, TruncatedForeignOrAbsurdBytesAreRefused) {
  const cv::Mat image(60, 80, CV_8UC3, cv::Scalar(1, 2, 3));
  const Bytes whole = EncodeColor(image);
  for (const Bytes& good : {whole, EncodeColorLossless(image)})
    for (std::size_t size = 0; size < good.size(); ++size)
      EXPECT_THROW(DecodeColor(Bytes(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size))), std::runtime_error) << size;
  EXPECT_THROW(DecodeColor(Bytes(1000, 0x42)), std::runtime_error);
  Bytes absurd = whole;
  for (std::size_t i = 0; i + 9 < absurd.size(); ++i)
    if (absurd[i] == 0xFF && absurd[i + 1] == 0xC0) absurd[i + 5] = absurd[i + 7] = 0xFE;
  EXPECT_THROW(DecodeColor(absurd), std::runtime_error);
  Bytes wide = EncodeColorLossless(image);
  wide[16] = 0x7F;
  EXPECT_THROW(DecodeColor(wide), std::runtime_error);
}

}  // namespace
}  // namespace vantage::rgbd
