// What both mounts ask of OMPL. Internal to motion.
#pragma once

#include <ompl/base/MotionValidator.h>
#include <ompl/geometric/PathGeometric.h>

#include <cstdint>
#include <functional>

namespace vantage::motion {

// Leaves it to a function whether the straight move between two states is free; says nothing of how far one gets.
class MoveValidator : public ompl::base::MotionValidator {
 public:
  using IsMoveFree = std::function<bool(const ompl::base::State* from, const ompl::base::State* to)>;

  MoveValidator(const ompl::base::SpaceInformationPtr& space, IsMoveFree is_move_free)
      : MotionValidator(space), is_move_free_(std::move(is_move_free)) {}

  bool checkMotion(const ompl::base::State* from, const ompl::base::State* to) const override { return is_move_free_(from, to); }
  bool checkMotion(const ompl::base::State* from, const ompl::base::State* to,
                   std::pair<ompl::base::State*, double>& last_valid) const override;

 private:
  IsMoveFree is_move_free_;
};

// Leaves out corners and cuts short between them, `steps` times each. OMPL's generators are seeded from a process-wide sequence;
// here equal seeds give equal paths.
void CutShort(std::uint32_t seed, unsigned steps, ompl::geometric::PathGeometric& path);

}  // namespace vantage::motion
