#include "vantage/object_trials.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "vantage/trial_record.h"

namespace vantage::cli {
namespace {

constexpr std::size_t kMaxBackgrounds = 32;
constexpr std::size_t kMaxLookAlikes = 4;  // As the assessor process.

// At most kMaxBackgrounds.
template <typename Value>
std::vector<Value> EvenlyChosen(const std::vector<Value>& all) {
  const std::size_t count = std::min(kMaxBackgrounds, all.size());
  std::vector<Value> chosen;
  for (std::size_t i = 0; i < count; ++i) chosen.push_back(all[i * all.size() / count]);
  return chosen;
}

// The folder's images by name; other files are passed over.
std::vector<cv::Mat> ReadBackgrounds(const std::filesystem::path& folder) {
  if (!std::filesystem::is_directory(folder)) throw std::runtime_error(folder.string() + ": no such folder of background images");
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.is_regular_file() && cv::haveImageReader(entry.path().string())) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<cv::Mat> images;
  for (const std::filesystem::path& file : EvenlyChosen(files)) {
    cv::Mat image = cv::imread(file.string(), cv::IMREAD_COLOR);
    if (!image.empty()) images.push_back(std::move(image));
  }
  if (images.empty()) throw std::runtime_error(folder.string() + ": holds no images that can be read");
  return images;
}

std::vector<const model::View*> ViewsWithMask(const model::ObjectModel& object) {
  std::vector<const model::View*> views;
  for (const model::View& view : object.views) {
    if (!view.mask.empty()) views.push_back(&view);
  }
  return views;
}

std::vector<cv::Mat> OwnBackgrounds(const model::ObjectModel& object) {
  std::vector<cv::Mat> images;
  for (const model::View* view : EvenlyChosen(ViewsWithMask(object))) {
    images.push_back(assessment::MaskedBackground(view->keyframe.color, view->mask));
  }
  return images;
}

// Some backgrounds again with the store's other objects in them.
std::vector<cv::Mat> LookAlikes(const model::ObjectModel& object, const std::vector<cv::Mat>& backgrounds,
                                const model::Store& store) {
  std::vector<cv::Mat> images;
  for (const model::Store::Summary& summary : store.List()) {
    if (summary.name == object.name || summary.views == 0 || backgrounds.empty() || images.size() >= kMaxLookAlikes) continue;
    const auto other = store.Load(summary.name);
    const auto seed = static_cast<std::uint32_t>(images.size());
    if (other) images.push_back(assessment::WithLookAlike(backgrounds[images.size() % backgrounds.size()], *other, seed));
  }
  return images;
}

void Tell(const std::string& name, int done, int of) {
  if (done % 10 == 0 || done == of) std::cerr << '\r' << name << ": " << done << " of " << of << " virtual images" << std::flush;
  if (done == of) std::cerr << '\n';
}

// What kept trials hold for: all that they depend on but their number.
std::string KeyOf(const std::string& object, const std::string& folder, const params::LibraryParams& params) {
  std::string key = object + "|" + folder;
  for (const auto& [name, value] : params::Flatten(params)) {
    const bool of_trials = name.rfind("recogniser.", 0) == 0 || name.rfind("trials.", 0) == 0;
    if (of_trials && name != "trials.trials_per_view" && name != "trials.observed_fit") key += "|" + name + "=" + value;
  }
  return key;
}

int Shown(const std::vector<assessment::Trial>& trials) {
  return static_cast<int>(
      std::count_if(trials.begin(), trials.end(), [](const assessment::Trial& one) { return one.object_shown; }));
}

}  // namespace

std::vector<assessment::Background> BackgroundsFor(const model::ObjectModel& object, const std::string& folder,
                                                   const model::Store& store) {
  const std::vector<cv::Mat> images = folder.empty() ? OwnBackgrounds(object) : ReadBackgrounds(folder);
  std::vector<assessment::Background> backgrounds;
  for (const cv::Mat& image : images) backgrounds.push_back({image, nullptr});
  // Spread out: only so many backgrounds are tried as negatives.
  std::size_t place = 1;
  for (const cv::Mat& image : LookAlikes(object, images, store)) {
    backgrounds.insert(backgrounds.begin() + static_cast<std::ptrdiff_t>(std::min(place, backgrounds.size())), {image, nullptr});
    place += 2;
  }
  return backgrounds;
}

std::vector<assessment::Trial> RunObjectTrials(const model::ObjectModel& object, std::vector<assessment::Background>* backgrounds,
                                               const params::LibraryParams& params) {
  return assessment::RunTrials(object, 0, backgrounds, params.recogniser, params.trials,
                               [&](int done, int of) { Tell(object.name, done, of); });
}

std::vector<assessment::Trial> KeptObjectTrials(const std::string& file, const model::ObjectModel& object,
                                                const std::string& folder, std::vector<assessment::Background>* backgrounds,
                                                int images, const params::LibraryParams& params) {
  const int views = static_cast<int>(object.views.size());
  assessment::TrialParams trials = params.trials;
  trials.trials_per_view = std::max(1, (images + views - 1) / views - trials.negatives_per_view);
  TrialRecord record(file, KeyOf(object.name, folder, params));
  std::vector<assessment::Trial> result;
  std::vector<int> so_far;
  for (int view = 0; view < views; ++view) {
    so_far.push_back(view);
    const model::View& learned = object.views[static_cast<std::size_t>(view)];
    if (learned.points.empty() || learned.keyframe.depth.empty()) continue;  // Nothing that could be shown or recognised.
    const auto* known = record.Find(learned.id, learned.utime);
    if (known == nullptr || Shown(*known) < trials.trials_per_view) {
      const std::string name = object.name + ", view " + std::to_string(view + 1) + " of " + std::to_string(views);
      record.Add(learned.id, learned.utime,
                 assessment::RunTrials(object.OnlyViews(so_far), view, backgrounds, params.recogniser, trials,
                                       [&](int done, int of) { Tell(name, done, of); }));
      known = record.Find(learned.id, learned.utime);
    }
    result.insert(result.end(), known->begin(), known->end());
  }
  return result;
}

}  // namespace vantage::cli
