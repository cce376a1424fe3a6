// Runs of `vantage explore`, one by one or to compare strategies; internal to that verb.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "session/explore.h"
#include "vantage/scenario.h"
#include "vantage/verb.h"

namespace vantage::cli {

struct ExploreOptions {
  CommonOptions common;
  std::string sequence;
  int object_id = 0;  // 0 = not given.
  std::string world;
  std::vector<std::string> meshes;
  std::string object;
  std::string strategy = "planner";
  int runs = 1;
  int judge_views = 200;
  int judge_views_over_time = 0;
  bool judge_over_time = false;
  std::string store;
  std::string compare;                  // Folder of a comparison; empty = none.
  std::vector<std::string> strategies;  // To compare.
  bool quick = false;
};

session::ExploreParams ParamsOf(const ExploreOptions& options, const params::LibraryParams& params, const Scenario& scenario,
                                std::uint32_t seed);

// One run. Where the object cannot be made out from a start, the next one is taken: which comes first is the seed's choice,
// whatever the strategy. Throws as session::Explore.
session::ExploreResult RunOnce(const Scenario& scenario, const session::ExploreParams& params, const std::string& suffix,
                               model::Store* store, const std::function<void(const session::ExploreStep&)>& progress);

Json ToJson(const session::ExploreResult& run);
std::string SummaryOf(const session::ExploreResult& run);  // One line.

// `vantage explore --compare` (explore_compare.cpp). Throws std::runtime_error.
void Compare(const ExploreOptions& options);

// What the runs of a comparison say: a table for people, figures, and plots (compare_figures.cpp). `runs` are those kept on disk,
// each with its "world".
struct CompareFigures {
  Json figures;
  std::string table;
};
CompareFigures FiguresOf(const std::vector<Json>& runs, const std::vector<std::string>& strategies);
// DIR/<group>.dat, DIR/<group>.gnuplot and, where that program is found, DIR/<group>.png: completeness and true rate over robot
// time.
void PlotRuns(const std::vector<Json>& runs, const std::vector<std::string>& strategies, const std::filesystem::path& folder);

}  // namespace vantage::cli
