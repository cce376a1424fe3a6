#include "motion/ompl_support.h"

#include <ompl/base/SpaceInformation.h>
#include <ompl/geometric/PathSimplifier.h>

namespace vantage::motion {
namespace {

class SeededSimplifier : public ompl::geometric::PathSimplifier {
 public:
  SeededSimplifier(const ompl::base::SpaceInformationPtr& space, std::uint32_t seed) : PathSimplifier(space) {
    rng_.setLocalSeed(seed);
  }
};

}  // namespace

bool MoveValidator::checkMotion(const ompl::base::State* from, const ompl::base::State* to,
                                std::pair<ompl::base::State*, double>& last_valid) const {
  if (checkMotion(from, to)) return true;
  if (last_valid.first != nullptr) si_->copyState(last_valid.first, from);
  last_valid.second = 0.0;
  return false;
}

void CutShort(std::uint32_t seed, unsigned steps, ompl::geometric::PathGeometric& path) {
  SeededSimplifier simplifier(path.getSpaceInformation(), seed);
  simplifier.reduceVertices(path, steps, steps);
  simplifier.shortcutPath(path, steps, steps);
  simplifier.reduceVertices(path, steps, steps);
}

}  // namespace vantage::motion
