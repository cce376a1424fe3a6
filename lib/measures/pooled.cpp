#include "measures/pooled.h"

#include <cmath>

namespace vantage::measures {
namespace {

// Mean and variance of all together.
Gaussian Mixture(const std::vector<Gaussian>& parts) {
  Gaussian mixture{0.0, 0.0, 0};
  double count = 0.0;
  for (const Gaussian& part : parts) {
    mixture.mean += part.mean;
    count += part.count;
  }
  const double n = static_cast<double>(parts.size());
  mixture.mean /= n;
  double variance = 0.0;
  for (const Gaussian& part : parts) variance += part.sigma * part.sigma + (part.mean - mixture.mean) * (part.mean - mixture.mean);
  mixture.sigma = std::sqrt(variance / n);
  mixture.count = static_cast<int>(std::lround(count / n));
  return mixture;
}

}  // namespace

ObservedSuccess PooledObserved(const std::vector<ObservedSuccess>& measures) {
  std::vector<Gaussian> positive, negative;
  for (const ObservedSuccess& measure : measures) {
    if (measure.source() != Source::kOwn) continue;
    positive.push_back(measure.positive());
    negative.push_back(measure.negative());
  }
  if (positive.empty()) return {};
  return {Mixture(positive), Mixture(negative), Source::kPooled};
}

PredictedSuccess PooledPredicted(const std::vector<PredictedSuccess>& measures) {
  std::vector<double> trials, successes;
  int objects = 0;
  double prior_count = 0.0, common_cause = 0.0;
  for (const PredictedSuccess& measure : measures) {
    if (measure.source() != Source::kOwn) continue;
    trials.resize(measure.trial_counts().size());
    successes.resize(trials.size());
    for (std::size_t i = 0; i < trials.size(); ++i) {
      trials[i] += measure.trial_counts()[i];
      successes[i] += measure.success_counts()[i];
    }
    prior_count = measure.prior_count();
    common_cause += measure.common_cause();
    ++objects;
  }
  if (objects == 0) return {};
  for (double& count : trials) count /= objects;
  for (double& count : successes) count /= objects;
  auto pooled = PredictedSuccess::FromCounts(std::move(trials), std::move(successes), Source::kPooled, prior_count);
  pooled.set_common_cause(common_cause / objects);
  return pooled;
}

Measures Pooled(const std::vector<Measures>& measures, const std::string& fingerprint) {
  std::vector<ObservedSuccess> observed;
  std::vector<PredictedSuccess> predicted;
  for (const Measures& one : measures) {
    if (one.fingerprint != fingerprint) continue;
    observed.push_back(one.observed);
    predicted.push_back(one.predicted);
  }
  Measures pooled{PooledObserved(observed), PooledPredicted(predicted), ""};
  if (pooled.observed.source() != Source::kDefault || pooled.predicted.source() != Source::kDefault)
    pooled.fingerprint = fingerprint;
  return pooled;
}

}  // namespace vantage::measures
