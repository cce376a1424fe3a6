// What strategies share: gain (14), the memory of failures and costs learned on the way. Internal to exploration.
#pragma once

#include <vector>

#include "exploration/planner.h"

namespace vantage::exploration {

// Completeness and its gain for many tentative views over one belief. Building costs views x queries evaluations of (12), each
// gain one per query.
class GainScorer {
 public:
  // Refers to the belief, which must outlive it.
  GainScorer(const Belief& belief, measures::CompletenessRule rule);

  double completeness() const { return completeness_; }  // Equation (13).

  // Equation (14): Completeness(views + view) - Completeness(views); >= 0.
  double Gain(const measures::Viewpoint& view) const;

 private:
  struct Query {
    measures::Viewpoint viewpoint;
    double weight = 0.0;                // All sum to 1.
    measures::JointProbability so_far;  // Of the views learned.
  };

  double ValueOf(const measures::JointProbability& joint) const;

  const Belief& belief_;
  measures::CompletenessRule rule_;
  std::vector<Query> queries_;
  double completeness_ = 0.0;
};

// Attempts that added no view lower the belief in views near by until one is added.
class FailureMemory {
 public:
  FailureMemory(double radius_rad, double discount) : radius_rad_(radius_rad), discount_(discount) {}

  void Note(const Attempt& attempt);
  // Factor on the detection probability: discount^(failures near by).
  double Factor(const measures::Viewpoint& view) const;

 private:
  double radius_rad_, discount_;
  std::vector<measures::Viewpoint> failures_;
};

// The mean of what a step took, the first guess counting as one observation.
class RunningMean {
 public:
  explicit RunningMean(double first_guess) : sum_(first_guess) {}

  void Add(double value) {
    sum_ += value;
    ++count_;
  }
  double mean() const { return sum_ / count_; }

 private:
  double sum_;
  int count_ = 1;
};

}  // namespace vantage::exploration
