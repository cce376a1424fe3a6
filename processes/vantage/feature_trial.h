// Kinds of features held against each other: one object of a recording, learned and recognised by cross-validation.
#pragma once

#include <string>
#include <vector>

#include "recognition/recogniser.h"
#include "rgbd/bop.h"

namespace vantage::cli {

struct FeatureSetting {
  std::string name;
  features::FeatureParams features;
  int jpeg_quality = 0;  // The images are coded as on the bus, those learned from and those asked about; 0: they are as they are.
};

// TYPE:MAX_KEYPOINTS:CONTRAST, and where wanted :JPEG_QUALITY. Throws std::runtime_error with what was expected.
FeatureSetting ParseFeatureSetting(const std::string& text);

struct FeatureFigures {
  int frames = 0;                // In which at least half of the object's surface lies in the image.
  int found = 0;                 // ...with a pose less than 40 mm from the truth (mean point distance), whatever its p(o|c).
  int found_10mm = 0;            // ...less than 10 mm.
  int right = 0;                 // ...with a detection (p(o|c) >= 1/2) less than 40 mm from it.
  int right_10mm = 0;            // ...less than 10 mm.
  int wrong = 0;                 // Detections 40 mm or more from the truth, in all frames.
  int views = 0;                 // Learned, over all folds.
  int view_points = 0;           // In them.
  std::vector<double> coded_kb;  // Of every frame that was asked about; as JPEG, else empty.
  std::vector<double> points;    // Of every frame that was asked about.
  std::vector<double> extract_ms, whole_ms, extract_cpu_ms, whole_cpu_ms;  // Wall clock; processor time of all cores.
};

// Frames are dealt to `folds` in turn; of each fold all settings are asked about the same frames one after the other, so that
// whatever else runs on the machine slows all of them. Views are learned at true poses in the object's label, every frame is one;
// poses are found in colour alone. One result per setting.
// Throws std::runtime_error where the recording has no truth, labels or depth of the object.
std::vector<FeatureFigures> TryFeatures(const rgbd::BopScene& scene, const std::vector<int>& ids, int object_id, int folds,
                                        const std::vector<FeatureSetting>& settings,
                                        const recognition::RecogniserParams& recogniser);

}  // namespace vantage::cli
