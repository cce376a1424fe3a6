// Backgrounds for virtual views from the run's own frames.
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>

#include "features/features.h"
#include "model/object_model.h"

namespace vantage::assessment {

class StrengthLimit;

// An image virtual views are pasted over, and that does not show the object itself, with what is found out about it on the way: of
// use for one set of recogniser and trial parameters.
struct Background {
  cv::Mat color;                                                 // CV_8UC3 BGR.
  std::shared_ptr<const features::Features> features = nullptr;  // Of the whole image; null until they are asked for.
  std::shared_ptr<StrengthLimit> limit = nullptr;                // Likewise, of the interest points a whole image keeps.
};

// The image with another object in it, one of its views turned by up to 30 degrees, at a random place: the object at hand must not
// be taken for it. The image as it is where the other's surface is not known. Deterministic in all arguments. Cost: 50 ms.
cv::Mat WithLookAlike(const cv::Mat& color, const model::ObjectModel& other, std::uint32_t seed);

// The image with the masked part (CV_8UC1, non-zero = object, grown by a few pixels) filled in from its surroundings, so that no
// real object is left in it. Both of one size. Cost: about 20 ms for 640 x 480.
cv::Mat MaskedBackground(const cv::Mat& color, const cv::Mat& mask);

}  // namespace vantage::assessment
