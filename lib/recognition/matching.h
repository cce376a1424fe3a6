// The matching stage: tentative matches between a frame's interest points and every known object (section IV-A).
#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "features/features.h"
#include "model/object_model.h"

namespace vantage::recognition {

// One interest point of a stored view.
struct Entry {
  int view;
  int keypoint;
  int point;
};

// An object made ready for matching.
struct Known {
  std::shared_ptr<const model::ObjectModel> object;
  cv::Mat descriptors;                        // Of all views, stacked.
  std::vector<Entry> entries;                 // One per row.
  std::vector<int> groups;                    // One per row.
  std::vector<Eigen::Vector2d> centre_pixel;  // Of the object, per view.
  std::vector<double> radius_px;              // Of the object, per view.
};

// A tentative match: a keypoint of the frame and a row (entry) of the object.
struct Tentative {
  int keypoint;
  int row;
};

struct ObjectMatches {
  const Known* known = nullptr;  // Of the matcher: valid until it changes.
  std::vector<Tentative> matches;
};

class Matcher {
 public:
  // max_ratio: best over second-best descriptor distance, the second best sought at other places of the object.
  explicit Matcher(double max_ratio) : max_ratio_(max_ratio) {}

  // Adds the object or replaces what was known of it.
  void Set(std::shared_ptr<const model::ObjectModel> object);
  void Remove(const std::string& name);
  int size() const { return static_cast<int>(objects_.size()); }

  // The objects that may be in the frame.
  std::vector<ObjectMatches> Match(const features::Features& features) const;

 private:
  double max_ratio_;
  std::map<std::string, Known> objects_;
};

}  // namespace vantage::recognition
