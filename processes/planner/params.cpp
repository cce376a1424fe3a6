#include <algorithm>
#include <stdexcept>

#include "common/params.h"
#include "planner/node.h"

namespace vantage::planner {

void PlannerNodeParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(what);
  };
  const auto& names = exploration::StrategyNames();
  const bool known = std::find(names.begin(), names.end(), strategy) != names.end();
  require(known && strategy != "oracle", "strategy must be planner, random, nearest, sweep or coverage");
  require(wait_s > 0.0, "wait_s must be > 0");
  require(measures_wait_s >= 0.0, "measures_wait_s must be >= 0");
  require(max_unmeasured_views >= 0, "max_unmeasured_views must be >= 0");
  require(time_limit_s > 0.0, "time_limit_s must be > 0");
  require(settle_s >= 0.0, "settle_s must be >= 0");
  require(look_frames >= 1, "look_frames must be >= 1");
  require(look_s > 0.0, "look_s must be > 0");
  require(silence_s > 0.0, "silence_s must be > 0");
  require(resend_s > 0.0, "resend_s must be > 0");
  require(max_refusals >= 1, "max_refusals must be >= 1");
  require(publish_period_s > 0.0, "publish_period_s must be > 0");
  require(table_size_m > 0.0, "table_size_m must be > 0");
  require(table_height_m > 0.0, "table_height_m must be > 0");
  planner.Check();
  candidates.Check();
  mount.Check();
}

PlannerNodeParams LoadPlannerNodeParams(const std::string& config_file, const std::string& library_file) {
  PlannerNodeParams params;
  if (!library_file.empty()) {
    const auto library = params::LoadLibraryParams(library_file);
    params.planner = library.planner;
    params.learner = {library.learner.min_track_probability, library.learner.new_view_confidence};
    params.candidates = library.candidates;
    params.mount = library.mount;
  }
  if (config_file.empty()) return params;
  auto yaml = config::Mapping::Load(config_file);
  yaml.Get("strategy", params.strategy);
  yaml.Get("seed", params.seed);
  yaml.Get("wait_s", params.wait_s);
  yaml.Get("measures_wait_s", params.measures_wait_s);
  yaml.Get("max_unmeasured_views", params.max_unmeasured_views);
  yaml.Get("time_limit_s", params.time_limit_s);
  yaml.Get("settle_s", params.settle_s);
  yaml.Get("look_frames", params.look_frames);
  yaml.Get("look_s", params.look_s);
  yaml.Get("silence_s", params.silence_s);
  yaml.Get("resend_s", params.resend_s);
  yaml.Get("max_refusals", params.max_refusals);
  yaml.Get("publish_period_s", params.publish_period_s);
  yaml.Get("table_size_m", params.table_size_m);
  yaml.Get("table_height_m", params.table_height_m);
  yaml.Get("summary", params.summary);
  yaml.Get("exit_when_done", params.exit_when_done);
  yaml.Finish();
  yaml.Check(params);
  return params;
}

}  // namespace vantage::planner
