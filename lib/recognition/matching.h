// The matching stage: tentative matches between a frame's interest points and every known object (section IV-A).
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "features/features.h"
#include "model/object_model.h"

namespace vantage::recognition {

struct MatchingParams {
  double max_ratio = 0.85;       // All compared: best over second-best descriptor distance, at other places of the object; (0, 1].
  int exhaustive_points = 4000;  // Up to so many stored interest points all are compared; beyond, those in the tree's leaves; >= 0.
  int max_candidates = 20;       // By the tree: only so many objects, the most likely, go on; >= 1.
  int paths = 12;                // Leaves of the tree that an interest point looks into; >= 1.
  int neighbours = 10;           // The distance to this many-th place is what a chance match has; >= 2.
  double max_chance_ratio = 0.85;     // Distance of a match over that of a chance match; (0, 1].
  std::string ranking = "distance";   // Of objects: "distance" (sum of what their matches gain on chance) or "score" (5).
  std::string norm = "l1";            // Of score (5): "l1" or "l2".
  double background_documents = 1.0;  // B: w_i = ln((N + B) / N_i); > 0.
  std::string vocabulary;             // File of `vantage vocabulary train` to start from; empty = from the objects themselves.
  int branching = 16;                 // Children of a node of the tree that grows; [2, 256].
  int max_leaf_points = 200;          // A leaf that holds more is split; >= 0, 0 = never.

  void Check() const;  // Throws std::invalid_argument naming the field.
};

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
  std::vector<int> groups;                    // One per row: the place on the object.
  std::vector<int> first_row;                 // Of every view.
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

// With few objects every stored interest point is compared. With many, the vocabulary tree finds the stored points nearest to each
// of the frame's; a match is much nearer than the n-th nearest place is, whosever that is (McCann and Lowe, "Local naive Bayes
// nearest neighbor", 2012): the ratio test then also asks what else is known looks like this. Uses all cores; the result is the
// same.
class Matcher {
 public:
  // `descriptor`: the kind of the features ("sift"). Throws std::runtime_error where params.vocabulary is no vocabulary of theirs.
  Matcher(const MatchingParams& params, const std::string& descriptor);
  ~Matcher();
  Matcher(Matcher&&) noexcept;
  Matcher& operator=(Matcher&&) noexcept;

  // Adds the object or replaces what was known of it; views that stayed as they were cost nothing in the tree.
  void Set(std::shared_ptr<const model::ObjectModel> object);
  void Remove(const std::string& name);
  int size() const;
  bool exhaustive() const;  // Whether there are so few points that all are compared.

  // The objects that may be in the frame: all by name, or the tree's candidates, the most likely first.
  std::vector<ObjectMatches> Match(const features::Features& features) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vantage::recognition
