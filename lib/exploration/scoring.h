// What strategies share: gain (14), the memory of failures and costs learned on the way. Internal to exploration.
#pragma once

#include <vector>

#include "exploration/planner.h"

namespace vantage::exploration {

// Completeness and its gain for many tentative views over one belief. Building costs views x queries evaluations of (12), each
// gain one per query.
class GainScorer {
 public:
  // Refers to the belief, which must outlive it. `well_known`: from where the object was found to be known already; they count as
  // views where gains are asked for, as nothing can be learned there, but not for completeness.
  GainScorer(const Belief& belief, measures::CompletenessRule rule, const std::vector<measures::Viewpoint>& well_known = {});

  double completeness() const { return completeness_; }  // Equation (13).

  // Equation (14): Completeness(views + view) - Completeness(views), well_known among the views; >= 0.
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

// How often attempts really detect the object where (12) says p: its log odds plus a shift that is the same everywhere, the maximum
// a posteriori of a logistic model with a Gaussian prior about the first guess.
class AttemptOdds {
 public:
  explicit AttemptOdds(double first_guess) : first_guess_(first_guess), shift_(first_guess) {}

  void Note(double predicted, bool detected);
  double Probability(double predicted) const;  // 0 stays 0, and 1 stays 1.

 private:
  struct Outcome {
    double log_odds;
    bool detected;
  };
  double first_guess_, shift_;
  std::vector<Outcome> outcomes_;
};

// Attempts that added no view lower the belief in views near by until one is added from less than kMatters_rad away: from further
// off the new view says nothing about the place. Where the object was well known no view was wanted: that is no failure.
class FailureMemory {
 public:
  FailureMemory(double radius_rad, double discount) : radius_rad_(radius_rad), discount_(discount) {}

  void Note(const Attempt& attempt);
  // Factor on the detection probability: discount^(failures near by).
  double Factor(const measures::Viewpoint& view) const;

 private:
  static constexpr double kMatters_rad = 0.6;

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
