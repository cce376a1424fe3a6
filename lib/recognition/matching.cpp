#include "recognition/matching.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <numeric>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

#include "recognition/inverted_file.h"

namespace vantage::recognition {
namespace {

constexpr double kGroupRadius = 0.008;  // Model points this near (metres) are one place on the object to the ratio test.

// Numbers the places: points nearer than kGroupRadius to a place's first point belong to it.
std::vector<int> GroupPoints(const std::vector<model::ModelPoint>& points) {
  std::map<std::array<int, 3>, std::vector<int>> cells;
  std::vector<int> group(points.size());
  const auto cell_of = [](const Eigen::Vector3d& p, int axis) { return static_cast<int>(std::floor(p[axis] / kGroupRadius)); };
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d& p = points[i].position;
    int found = -1;
    for (int n = 0; n < 27 && found < 0; ++n) {
      const auto cell = cells.find({cell_of(p, 0) + n % 3 - 1, cell_of(p, 1) + n / 3 % 3 - 1, cell_of(p, 2) + n / 9 - 1});
      if (cell == cells.end()) continue;
      for (const int leader : cell->second) {
        if ((points[leader].position - p).norm() < kGroupRadius) found = leader;
      }
    }
    if (found < 0) {
      found = static_cast<int>(i);
      cells[{cell_of(p, 0), cell_of(p, 1), cell_of(p, 2)}].push_back(found);
    }
    group[i] = found;
  }
  return group;
}

Known Prepare(std::shared_ptr<const model::ObjectModel> object) {
  Known known;
  known.object = object;
  Eigen::Vector3d lower = Eigen::Vector3d::Constant(1e9), upper = -lower;
  for (const model::ModelPoint& point : object->points) {
    lower = lower.cwiseMin(point.position);
    upper = upper.cwiseMax(point.position);
  }
  const Eigen::Vector3d centre = 0.5 * (lower + upper);
  const double radius_m = std::max(0.01, 0.5 * (upper - lower).norm());
  const std::vector<int> group = GroupPoints(object->points);
  for (size_t v = 0; v < object->views.size(); ++v) {
    const model::View& view = object->views[v];
    const Eigen::Vector3d centre_in_camera = view.T_camera_object * centre;
    known.first_row.push_back(static_cast<int>(known.entries.size()));
    known.centre_pixel.push_back(view.keyframe.camera.Project(centre_in_camera).value_or(Eigen::Vector2d::Zero()));
    known.radius_px.push_back(view.keyframe.camera.fx * radius_m / std::max(0.05, centre_in_camera.z()));
    for (int k = 0; k < view.features.size(); ++k) {
      known.entries.push_back({static_cast<int>(v), k, view.points[k]});
      known.groups.push_back(group[view.points[k]]);
    }
    known.descriptors.push_back(view.features.descriptors);
  }
  return known;
}

// Rows that a thread takes at once.
constexpr int kRowsAtOnce = 64;
// Views of one place on an object count once among the neighbours: so many stored points are looked at for each place wanted.
constexpr int kViewsOfPlace = 4;
constexpr std::size_t kMinMatches = 4;  // Fewer give no pose.

// visit(first row, last row + 1) for pieces of all rows, on all cores.
template <typename Visitor>
void ForRows(int rows, const Visitor& visit) {
  const int pieces = (rows + kRowsAtOnce - 1) / kRowsAtOnce;
  cv::parallel_for_(cv::Range(0, pieces), [&](const cv::Range& range) {
    for (int p = range.start; p < range.end; ++p) visit(p * kRowsAtOnce, std::min(rows, (p + 1) * kRowsAtOnce));
  });
}

bool SameDescriptors(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != b.type()) return false;
  for (int row = 0; row < a.rows && a.data != b.data; ++row) {
    if (std::memcmp(a.ptr(row), b.ptr(row), a.cols * a.elemSize()) != 0) return false;
  }
  return true;
}

// What names each view in the inverted file: its id, so that views keep their names when others go; its index where ids repeat.
std::vector<int> ViewNumbers(const model::ObjectModel& object) {
  std::vector<int> numbers;
  for (const model::View& view : object.views) numbers.push_back(view.id);
  std::vector<int> sorted = numbers;
  std::sort(sorted.begin(), sorted.end());
  if (std::adjacent_find(sorted.begin(), sorted.end()) == sorted.end() && (sorted.empty() || sorted[0] >= 0)) return numbers;
  std::iota(numbers.begin(), numbers.end(), 0);
  return numbers;
}

}  // namespace

void MatchingParams::Check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("matching: ") + what);
  };
  require(max_ratio > 0.0 && max_ratio <= 1.0, "max_ratio must be in (0, 1]");
  require(exhaustive_points >= 0, "exhaustive_points must be >= 0");
  require(max_candidates >= 1, "max_candidates must be >= 1");
  require(paths >= 1, "paths must be >= 1");
  require(neighbours >= 2, "neighbours must be >= 2");
  require(max_chance_ratio > 0.0 && max_chance_ratio <= 1.0, "max_chance_ratio must be in (0, 1]");
  require(ranking == "distance" || ranking == "score", "ranking must be \"distance\" or \"score\"");
  require(norm == "l1" || norm == "l2", "norm must be \"l1\" or \"l2\"");
  require(background_documents > 0.0, "background_documents must be > 0");
  require(branching >= 2 && branching <= 256, "branching must be in [2, 256]");
  require(max_leaf_points >= 0, "max_leaf_points must be >= 0");
}

struct Matcher::Impl {
  MatchingParams params;
  std::string descriptor;
  std::map<std::string, Known> objects;
  int points = 0;
  std::optional<InvertedFile> file;        // Made when there are too many points to compare them all; kept from then on.
  std::map<std::string, int> number_of;    // Of an object in the file.
  std::vector<const Known*> known_of;      // By that number; null where it is free.
  std::vector<std::vector<int>> views_of;  // By that number: the views' numbers in the file, by index.

  int Number(const std::string& name) {
    if (const auto found = number_of.find(name); found != number_of.end()) return found->second;
    auto free = std::find(known_of.begin(), known_of.end(), nullptr);
    const int number = static_cast<int>(free - known_of.begin());
    if (free == known_of.end()) {
      known_of.push_back(nullptr);
      views_of.emplace_back();
    }
    return number_of[name] = number;
  }

  void MakeFile(int length) {
    VocabularyParams tree;
    tree.branching = params.branching;
    InvertedFileParams settings;
    settings.norm = params.norm == "l1" ? Norm::kL1 : Norm::kL2;
    settings.background_documents = params.background_documents;
    settings.max_leaf_points = params.max_leaf_points;
    file.emplace(params.vocabulary.empty() ? VocabularyTree(descriptor, length, tree)
                                           : VocabularyTree::Load(params.vocabulary, descriptor, length),
                 settings);
    for (const auto& [name, known] : objects) Enter(known, nullptr);
  }

  // Brings the file up to date; `before` is what it holds of the object.
  void Enter(const Known& known, const model::ObjectModel* before) {
    const model::ObjectModel& object = *known.object;
    const int number = Number(object.name);
    known_of[number] = &known;
    const std::vector<int> old_views = std::exchange(views_of[number], ViewNumbers(object)), &views = views_of[number];
    for (std::size_t i = 0; i < old_views.size(); ++i) {
      if (std::find(views.begin(), views.end(), old_views[i]) == views.end()) file->RemoveView(number, old_views[i]);
    }
    for (std::size_t i = 0; i < views.size(); ++i) {
      const cv::Mat& descriptors = object.views[i].features.descriptors;
      const auto old = std::find(old_views.begin(), old_views.end(), views[i]);
      if (before != nullptr && old != old_views.end() &&
          SameDescriptors(before->views[old - old_views.begin()].features.descriptors, descriptors)) {
        continue;
      }
      file->SetView(number, views[i], descriptors);
    }
  }

  std::vector<ObjectMatches> CompareAll(const features::Features& features) const {
    std::vector<ObjectMatches> found;
    for (const auto& [name, known] : objects) {
      ObjectMatches& object = found.emplace_back();
      object.known = &known;
      const Known& stored = known;
      std::vector<features::NearestPair> nearest(features.size());
      ForRows(features.size(), [&](int begin, int end) {
        const auto part = features::NearestTwo(features.descriptors.rowRange(begin, end), stored.descriptors, stored.groups);
        std::copy(part.begin(), part.end(), nearest.begin() + begin);
      });
      for (std::size_t i = 0; i < nearest.size(); ++i) {
        if (nearest[i].best >= 0 && nearest[i].best_distance < params.max_ratio * nearest[i].second_distance) {
          object.matches.push_back({static_cast<int>(i), nearest[i].best});
        }
      }
    }
    return found;
  }

  int RowOf(const Neighbour& neighbour) const {
    const std::vector<int>& views = views_of[neighbour.object];
    const auto view = std::find(views.begin(), views.end(), neighbour.view) - views.begin();
    return known_of[neighbour.object]->first_row[view] + neighbour.keypoint;
  }

  struct Candidate {
    std::vector<Tentative> matches;
    double worth = 0.0;
  };

  // Of one interest point's neighbours those that are no chance, the nearest of each object.
  void AddMatches(int keypoint, const std::vector<Neighbour>& nearest, std::vector<Candidate>& candidates) const {
    std::vector<std::array<int, 2>> places;  // Object and place.
    std::vector<int> rows;
    std::size_t looked_at = 0;
    for (; looked_at < nearest.size() && static_cast<int>(places.size()) < params.neighbours; ++looked_at) {
      const int object = nearest[looked_at].object, row = RowOf(nearest[looked_at]);
      const std::array<int, 2> place = {object, known_of[object]->groups[row]};
      rows.push_back(row);
      if (std::find(places.begin(), places.end(), place) == places.end()) places.push_back(place);
    }
    if (places.size() < 2) return;
    const float chance = nearest[looked_at - 1].distance;
    std::vector<int> matched;
    for (std::size_t i = 0; i < looked_at && nearest[i].distance < params.max_chance_ratio * chance; ++i) {
      const int object = nearest[i].object;
      if (std::find(matched.begin(), matched.end(), object) != matched.end()) continue;
      matched.push_back(object);
      candidates[object].matches.push_back({keypoint, rows[i]});
      candidates[object].worth += chance * chance - nearest[i].distance * nearest[i].distance;
    }
  }

  std::vector<ObjectMatches> LookUp(const features::Features& features) const {
    std::vector<std::vector<Neighbour>> nearest(features.size());
    Words words;
    words.leaves.resize(features.size());
    ForRows(features.size(), [&](int begin, int end) {
      const cv::Mat rows = features.descriptors.rowRange(begin, end);
      const Words part = file->tree().Quantise(rows, params.paths);
      auto found = file->Nearest(rows, part, kViewsOfPlace * params.neighbours);
      std::move(found.begin(), found.end(), nearest.begin() + begin);
      for (int row = begin; row < end; ++row) words.leaves[row] = part.of(row - begin)[0];
    });
    std::vector<Candidate> candidates(known_of.size());
    for (int k = 0; k < features.size(); ++k) AddMatches(k, nearest[k], candidates);
    if (params.ranking == "score") {
      for (Candidate& candidate : candidates) candidate.worth = 0.0;
      for (const Ranked& ranked : file->Rank(words, file->objects())) candidates[ranked.object].worth = 2.0 - ranked.score;
    }
    std::vector<int> order;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (candidates[i].matches.size() >= kMinMatches) order.push_back(static_cast<int>(i));
    }
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return candidates[a].worth > candidates[b].worth; });
    if (static_cast<int>(order.size()) > params.max_candidates) order.resize(params.max_candidates);
    std::vector<ObjectMatches> found;
    for (const int object : order) found.push_back({known_of[object], std::move(candidates[object].matches)});
    return found;
  }
};

Matcher::Matcher(const MatchingParams& params, const std::string& descriptor) : impl_(std::make_unique<Impl>()) {
  params.Check();
  if (!params.vocabulary.empty()) VocabularyTree::CheckFile(params.vocabulary, descriptor);
  impl_->params = params;
  impl_->descriptor = descriptor;
}
Matcher::~Matcher() = default;
Matcher::Matcher(Matcher&&) noexcept = default;
Matcher& Matcher::operator=(Matcher&&) noexcept = default;

int Matcher::size() const { return static_cast<int>(impl_->objects.size()); }

bool Matcher::exhaustive() const { return impl_->points <= impl_->params.exhaustive_points; }

void Matcher::Set(std::shared_ptr<const model::ObjectModel> object) {
  Known& known = impl_->objects[object->name];
  const std::shared_ptr<const model::ObjectModel> before = known.object;
  impl_->points -= static_cast<int>(known.entries.size());
  known = Prepare(object);
  impl_->points += static_cast<int>(known.entries.size());
  if (impl_->file) {
    impl_->Enter(known, before.get());
  } else if (!exhaustive()) {
    impl_->MakeFile(known.descriptors.cols);
  }
}

void Matcher::Remove(const std::string& name) {
  const auto found = impl_->objects.find(name);
  if (found == impl_->objects.end()) return;
  impl_->points -= static_cast<int>(found->second.entries.size());
  if (impl_->file) {
    const int number = impl_->number_of.at(name);
    impl_->file->RemoveObject(number);
    impl_->known_of[number] = nullptr;
    impl_->views_of[number].clear();
    impl_->number_of.erase(name);
  }
  impl_->objects.erase(found);
}

std::vector<ObjectMatches> Matcher::Match(const features::Features& features) const {
  return exhaustive() ? impl_->CompareAll(features) : impl_->LookUp(features);
}

}  // namespace vantage::recognition
