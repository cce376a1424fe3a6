// What `vantage explore` explores: a recording whose views can be visited, or a simulated world; with the truth to judge by.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/params.h"
#include "session/explore.h"
#include "session/judge.h"

namespace vantage::cli {

struct Scenario {
  std::shared_ptr<const simulation::World> world;
  std::unique_ptr<session::Judge> judge;
  std::vector<session::ExploreStart> starts;  // Where a run may begin, at least one.
  recognition::RecogniserParams recogniser;   // As used in this world, by the learner too.
  bool judge_over_time = false;
};

// The even frames can be visited, the odd ones judge. The object's surface is taken from `mesh_file`, or where that is empty from
// the depth under its labels. Starts are the visitable frames that show all of the object. The depth of a recording may have been
// rendered from the truth: poses are recognised without it.
// Throws std::runtime_error where truth, poses or labels are missing.
Scenario RecordedScenario(const std::string& folder, int object_id, const std::string& mesh_file,
                          const params::LibraryParams& params);

// `world_file` is a world's YAML; where it is empty, a table with `mesh_files` on it, the first in the middle. `object` names the
// one to explore; empty = the first. Judged by `judge_views` random views of the reachable part of its view sphere. Runs begin at
// the world's start pose; with `several_starts` at that and seven more, turned about the object. Throws std::runtime_error where a
// file cannot be read or there is no such object.
Scenario SimulatedScenario(const std::string& world_file, const std::vector<std::string>& mesh_files, const std::string& object,
                           int judge_views, const params::LibraryParams& params, std::uint32_t seed, bool several_starts = false);

}  // namespace vantage::cli
