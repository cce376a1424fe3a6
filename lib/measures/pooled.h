// What is known of an object that has no measures of its own yet: what holds for others on average.
#pragma once

#include <vector>

#include "measures/completeness.h"

namespace vantage::measures {

// Of all with both measures their own; all count the same however many trials they had, as objects differ more than trials do, and
// the result is as sure as one of them. p(o|c) is by Gaussians: those of the mixture. The shipped default where there is none.
ObservedSuccess PooledObserved(const std::vector<ObservedSuccess>& measures);
PredictedSuccess PooledPredicted(const std::vector<PredictedSuccess>& measures);

// Those of objects with this fingerprint.
Measures Pooled(const std::vector<Measures>& measures, const std::string& fingerprint);

}  // namespace vantage::measures
