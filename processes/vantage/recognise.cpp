// vantage recognise: every stored object in the frames of a recording.
#include "recognition/recogniser.h"

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <sstream>

#include "model/store.h"
#include "vantage/overlay.h"
#include "vantage/sequence.h"
#include "vantage/truth_judge.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

struct RecogniseOptions {
  CommonOptions common;
  std::string store;
  std::string sequence;
  std::string frames = "all";
  std::string bop;       // Result in the BOP challenge's format; empty = none.
  std::string overlays;  // Folder for one picture a frame; empty = none.
  bool no_query_depth = false;
  std::optional<int> truth_object_id;  // Hold the detections of the store's only object against the truth of this one.
};

struct FrameResult {
  int id = 0;
  double ms = 0.0;
  std::vector<recognition::Detection> detections;
};

Json ToJson(const FrameResult& frame) {
  Json detections = Json::array();
  for (const recognition::Detection& detection : frame.detections) {
    Json entry;
    entry["object"] = detection.object;
    entry["T_camera_object"] = cli::ToJson(detection.T_camera_object);
    entry["confidence"] = Number(detection.confidence.value);
    entry["probability"] = Number(detection.probability);
    entry["source"] = measures::ToString(detection.source);
    entry["inliers"] = detection.inliers;
    detections.push_back(std::move(entry));
  }
  Json result;
  result["id"] = frame.id;
  result["ms"] = frame.ms;
  result["detections"] = std::move(detections);
  return result;
}

// The number at the end of a text such as "obj_000003"; `otherwise` where there is none.
int TrailingNumber(const std::string& text, int otherwise) {
  const std::size_t last = text.find_last_not_of("0123456789");
  const std::string digits = last == std::string::npos ? text : text.substr(last + 1);
  return digits.empty() || digits.size() > 9 ? otherwise : std::stoi(digits);
}

// One line per detection: scene_id,im_id,obj_id,score,R,t,time; R row-major, t in mm, the image's time in seconds. The pose is that
// of the stored object's own frame.
std::string ToBop(const std::vector<FrameResult>& frames, int scene_id, const std::map<std::string, int>& object_ids) {
  std::ostringstream text;
  text.precision(9);
  text << "scene_id,im_id,obj_id,score,R,t,time\n";
  for (const FrameResult& frame : frames) {
    for (const recognition::Detection& detection : frame.detections) {
      text << scene_id << ',' << frame.id << ',' << object_ids.at(detection.object) << ',' << detection.probability << ',';
      for (int i = 0; i < 9; ++i) text << (i == 0 ? "" : " ") << detection.T_camera_object(i / 3, i % 3);
      const Eigen::Vector3d t_mm = 1000.0 * detection.T_camera_object.translation();
      text << ',' << t_mm.x() << ' ' << t_mm.y() << ' ' << t_mm.z() << ',' << frame.ms / 1000.0 << '\n';
    }
  }
  return text.str();
}

// Every object of the store; name -> number for the BOP format: the number its name ends in, else its place in the list.
std::map<std::string, int> LoadObjects(const std::string& file, recognition::Recogniser& recogniser) {
  const model::Store store(file, model::Store::Mode::kRead);
  std::map<std::string, int> ids;
  for (const model::Store::Summary& summary : store.List()) {
    auto object = store.Load(summary.name);
    if (!object) continue;  // Removed since it was listed.
    ids[summary.name] = TrailingNumber(summary.name, static_cast<int>(ids.size()) + 1);
    try {
      const std::string mismatch = recognition::MeasuresMismatch(*object, recogniser.params());
      if (!mismatch.empty()) std::cerr << "vantage recognise: " << file << ": " << mismatch << '\n';
      recogniser.Set(std::make_shared<model::ObjectModel>(std::move(*object)));
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(file + ": " + error.what());
    }
  }
  if (ids.empty()) throw std::runtime_error(file + ": holds no objects; learn one with vantage learn");
  return ids;
}

Json ToJson(const Tally& tally) {
  Json result;
  result["frames"] = tally.frames;
  result["right"] = tally.right;
  result["right_10mm"] = tally.right_10mm;
  result["detections"] = tally.detections;
  result["wrong"] = tally.wrong;
  return result;
}

std::optional<TruthJudge> JudgeFor(const RecogniseOptions& options, const rgbd::BopScene& scene) {
  if (!options.truth_object_id) return std::nullopt;
  return TruthJudge(scene, *options.truth_object_id, OnlyObjectOf(options.store));
}

FrameResult RecogniseFrame(const recognition::Recogniser& recogniser, rgbd::Frame frame) {
  if (!recogniser.params().use_query_depth) frame.depth = cv::Mat();
  FrameResult result;
  result.id = static_cast<int>(frame.id);
  const auto start = std::chrono::steady_clock::now();
  result.detections = recogniser.Recognise(frame, recogniser.Extract(frame));
  result.ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return result;
}

void RunRecognise(const RecogniseOptions& options) {
  CheckOutput(options.common);
  if (!options.bop.empty()) CheckWritable(options.bop);
  if (!options.overlays.empty() && !std::filesystem::is_directory(options.overlays)) {
    throw std::runtime_error(options.overlays + ": --overlays needs a folder that is there");
  }
  params::LibraryParams params = LoadParams(options.common);
  if (options.no_query_depth) params.recogniser.use_query_depth = false;
  const rgbd::BopScene scene(options.sequence);
  const std::vector<int> ids = FramesOf(scene, options.frames);
  recognition::Recogniser recogniser(params.recogniser);
  const std::map<std::string, int> object_ids = LoadObjects(options.store, recogniser);

  std::optional<TruthJudge> judge = JudgeFor(options, scene);

  std::vector<FrameResult> frames;
  std::vector<double> ms;
  std::size_t detections = 0;
  for (const int id : ids) {
    const rgbd::Frame frame = scene.Load(id);
    frames.push_back(RecogniseFrame(recogniser, frame));
    if (judge) judge->Add(frame, frames.back().detections);
    if (!options.overlays.empty()) {
      const std::string file = options.overlays + "/" + std::to_string(id) + ".png";
      WritePicture(file, DrawDetections(frame, frames.back().detections));
    }
    ms.push_back(frames.back().ms);
    detections += frames.back().detections.size();
  }

  Json result;
  result["frames"] = Json::array();
  for (const FrameResult& frame : frames) result["frames"].push_back(ToJson(frame));
  result["ms_median"] = Number(Quantile(ms, 0.5));
  if (judge) result["truth"] = ToJson(judge->tally());
  if (!options.bop.empty()) {
    WriteWhole(options.bop, ToBop(frames, TrailingNumber(NameOfFolder(options.sequence), 0), object_ids));
  }
  std::ostringstream summary;
  summary.precision(3);
  summary << detections << " detections of " << object_ids.size() << " objects in " << frames.size() << " frames, "
          << Quantile(ms, 0.5) << " ms a frame\n";
  if (judge) {
    const Tally& tally = judge->tally();
    summary << tally.right << " of " << tally.frames << " frames right (40 mm), " << tally.right_10mm << " within 10 mm; "
            << tally.wrong << " of " << tally.detections << " detections wrong\n";
  }
  WriteResult(options.common, result, summary.str());
}

}  // namespace

void AddRecognise(CLI::App& app, Run& run) {
  auto options = std::make_shared<RecogniseOptions>();
  CLI::App* verb = app.add_subcommand("recognise", "Find every stored object in the frames of a recording, with pose and p(o|c)");
  AddCommonOptions(*verb, options->common);
  verb->add_option("--store", options->store, "The model store")->required()->type_name("FILE");
  verb->add_option("--sequence", options->sequence, "BOP scene folder")->required()->type_name("DIR");
  verb->add_option("--frames", options->frames, "Which frames: all, even, odd (by id), or ids A:B without B")
      ->capture_default_str();
  verb->add_flag("--no-query-depth", options->no_query_depth, "Use the colour image only");
  verb->add_option(
          "--truth-object-id", options->truth_object_id,
          "Count right and wrong detections (p >= 1/2) by the recording's truth of this object; the store holds one object, "
          "learned from this recording")
      ->type_name("N");
  verb->add_option(
          "--bop", options->bop,
          "Write the detections in the BOP challenge's format; obj_id is the number the object's name ends in, else its place in "
          "the store's list")
      ->type_name("FILE.csv");
  verb->add_option("--overlays", options->overlays,
                   "Write a picture of every frame (ID.png) with the convex hulls of the matched points of what was recognised")
      ->type_name("DIR");
  verb->callback([options, &run] { run = [options] { RunRecognise(*options); }; });
}

}  // namespace vantage::cli
