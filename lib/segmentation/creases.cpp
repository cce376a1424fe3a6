#include "segmentation/creases.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace vantage::segmentation {
namespace {

constexpr double kFocalPerPace_px = 260.0;  // Bends are looked for at every second pixel of a 640 x 480 frame.
constexpr double kJumpPerArm = 1.5;         // Where the depth cut-off is more than so many arms, noise bends everything.
constexpr float kFlat_deg = 15.0f;
constexpr int kMostSteps = 30;       // Of an arm.
constexpr float kBend_deg = 20.0f;   // From here on a pixel may be in a crease; whether it is one, its whole length says.
constexpr float kSteep_deg = 40.0f;  // Steep ones are widened: at their ends, beside a jump, arms do not reach.
constexpr double kWiden_mm_at_1m = 6.0;
constexpr int kSeedPixels = 40;  // Fewer between creases are no surface of their own.

// What arms are laid on.
struct Terrain {
  cv::Mat states;     // CV_8UC1 of PixelState; continuous, as is the next.
  cv::Mat disparity;  // CV_32FC1, 1/m, smoothed; 0 where there is no object.
  geometry::PinholeCamera camera;
};

// JumpAt in disparity: depth noise grows as disparity's does not.
float DisparityJump(float squared_disparity, const ClusterParams& params) {
  return static_cast<float>(params.max_jump_m) * std::max(1.0f, kJumpFloor_m2 * squared_disparity);
}

// Averages over the neighbours on the same surface.
cv::Mat Smoothed(const cv::Mat& disparity, const ClusterParams& params) {
  cv::Mat smooth(disparity.size(), CV_32FC1, cv::Scalar(0));
  for (int y = 1; y < disparity.rows - 1; ++y) {
    for (int x = 1; x < disparity.cols - 1; ++x) {
      const float here = disparity.at<float>(y, x);
      if (here <= 0.0f) continue;
      const float most = DisparityJump(here * here, params);
      float sum = 0.0f, count = 0.0f;
      for (int v = y - 1; v <= y + 1; ++v) {
        const float* row = disparity.ptr<float>(v);
        for (int u = x - 1; u <= x + 1; ++u) {
          if (row[u] <= 0.0f || std::abs(row[u] - here) > most) continue;
          sum += row[u];
          count += 1.0f;
        }
      }
      smooth.at<float>(y, x) = sum / count;
    }
  }
  return smooth;
}

Terrain TerrainOf(const cv::Mat& states, const cv::Mat& cloud, const geometry::PinholeCamera& camera, const ClusterParams& params) {
  cv::Mat disparity(states.size(), CV_32FC1, cv::Scalar(0));
  for (int y = 0; y < states.rows; ++y)
    for (int x = 0; x < states.cols; ++x)
      if (states.at<std::uint8_t>(y, x) == kAbove) disparity.at<float>(y, x) = 1.0f / cloud.at<cv::Vec3f>(y, x)[2];
  return {states.isContinuous() ? states : states.clone(), Smoothed(disparity, params), camera};
}

// An arm's outer half: its mean distance from where it begins, in steps (0: it does not reach), and its mean disparity.
struct Arm {
  float steps = 0.0f, disparity = 0.0f;
};

// Along a surface, over holes, not over a jump: there an arm of half the reach will do.
Arm LayArm(const Terrain& terrain, int x, int y, const cv::Point& direction, int reach, const ClusterParams& params) {
  std::array<float, kMostSteps + 1> laid;  // Disparity by step; 0 in a hole.
  const int room_x = direction.x > 0 ? terrain.states.cols - 1 - x : x, room_y = direction.y > 0 ? terrain.states.rows - 1 - y : y;
  const int end = std::min({reach, direction.x ? room_x : reach, direction.y ? room_y : reach});
  const std::ptrdiff_t stride = static_cast<std::ptrdiff_t>(direction.y) * terrain.disparity.cols + direction.x;
  const std::ptrdiff_t start = static_cast<std::ptrdiff_t>(y) * terrain.disparity.cols + x;
  const float* disparity = terrain.disparity.ptr<float>() + start;
  const std::uint8_t* states = terrain.states.ptr<std::uint8_t>() + start;
  float last = *disparity;
  int gap = 0, length = 0;
  for (int step = 1; step <= end; ++step) {
    const float next = laid[step] = disparity[step * stride];
    if (next <= 0.0f) {
      if (states[step * stride] == kOther || ++gap > params.bridge_px) break;
      continue;
    }
    if (std::abs(next - last) > DisparityJump(last * next, params) * (1.0f + 0.5f * static_cast<float>(gap))) break;
    gap = 0;
    last = next;
    length = step;
  }
  if (2 * length < reach) return {};
  float sum = 0.0f;
  int count = 0, steps = 0;
  for (int step = length / 2 + 1; step <= length; ++step) {
    if (laid[step] <= 0.0f) continue;
    sum += laid[step];
    steps += step;
    ++count;
  }
  return {static_cast<float>(steps) / static_cast<float>(count), sum / static_cast<float>(count)};
}

Eigen::Vector3f PointOf(const Terrain& terrain, float x, float y, float disparity) {
  const geometry::PinholeCamera& camera = terrain.camera;
  return Eigen::Vector3f((x - static_cast<float>(camera.cx)) / static_cast<float>(camera.fx),
                         (y - static_cast<float>(camera.cy)) / static_cast<float>(camera.fy), 1.0f) /
         disparity;
}

// Cosine between the arms along one direction; -1 where the surface bends outwards or the arms do not reach.
float CosineAlong(const Terrain& terrain, int x, int y, const cv::Point& direction, const ClusterParams& params) {
  const float here = terrain.disparity.at<float>(y, x);
  const double step_rad = (direction.x && direction.y ? std::sqrt(2.0) : 1.0) / terrain.camera.fx;
  const int reach = std::clamp(static_cast<int>(std::lround(params.crease_arm_m * here / step_rad)), 2, kMostSteps);
  const Arm back = LayArm(terrain, x, y, -direction, reach, params);
  if (back.steps <= 0.0f) return -1.0f;
  const Arm ahead = LayArm(terrain, x, y, direction, reach, params);
  if (ahead.steps <= 0.0f) return -1.0f;
  const float chord = (back.disparity * ahead.steps + ahead.disparity * back.steps) / (back.steps + ahead.steps);
  if (chord <= here)
    return -1.0f;  // A plane's disparity is linear in the image, so the chord is before the surface where it is hollow.
  const auto fx = static_cast<float>(x), fy = static_cast<float>(y);
  const auto dx = static_cast<float>(direction.x), dy = static_cast<float>(direction.y);
  const Eigen::Vector3f from = PointOf(terrain, fx, fy, here);
  const Eigen::Vector3f a = PointOf(terrain, fx - back.steps * dx, fy - back.steps * dy, back.disparity) - from;
  const Eigen::Vector3f b = PointOf(terrain, fx + ahead.steps * dx, fy + ahead.steps * dy, ahead.disparity) - from;
  return a.dot(b) / std::sqrt(a.squaredNorm() * b.squaredNorm());
}

// The most it bends, over four directions; 0 where depth noise drowns it.
float BendAt(const Terrain& terrain, int x, int y, const ClusterParams& params) {
  const float here = terrain.disparity.at<float>(y, x);
  if (here <= 0.0f || JumpAt(1.0f / here, params) > kJumpPerArm * params.crease_arm_m) return 0.0f;
  float cosine = -1.0f;
  for (const cv::Point& direction : {cv::Point(1, 0), cv::Point(0, 1), cv::Point(1, 1), cv::Point(-1, 1)})
    cosine = std::max(cosine, CosineAlong(terrain, x, y, direction, params));
  return 180.0f - std::acos(std::min(cosine, 1.0f)) * static_cast<float>(180.0 / M_PI);
}

// Object pixels that may lie in a crease become kCrease.
cv::Mat MarkCreases(const cv::Mat& states, const cv::Mat& bend, const geometry::PinholeCamera& camera) {
  const int widen_px = static_cast<int>(std::lround(1e-3 * kWiden_mm_at_1m * camera.fx));
  cv::Mat creases;
  cv::dilate(bend > kSteep_deg, creases,
             cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(2 * widen_px + 1, 2 * widen_px + 1)));
  creases |= bend > kBend_deg;
  cv::Mat marked = states.clone();
  marked.setTo(kCrease, creases & (states == kAbove));
  return marked;
}

// Gives new names to the labels; 0 stays.
void Rename(const std::vector<int>& names, cv::Mat& labels) {
  std::for_each(labels.begin<int>(), labels.end<int>(), [&names](int& label) { label = names[label]; });
}

// Keeps the labels of the larger pieces only. Returns how many.
int KeepSeeds(int count, cv::Mat& labels) {
  std::vector<int> pixels(count + 1, 0), names(count + 1, 0);
  std::for_each(labels.begin<int>(), labels.end<int>(), [&pixels](int label) { ++pixels[label]; });
  int kept = 0;
  for (int i = 1; i <= count; ++i)
    if (pixels[i] >= kSeedPixels) names[i] = ++kept;
  Rename(names, labels);
  return kept;
}

// Gives the pixels of creases to the surfaces beside them, the flattest first, so that these meet where the bend is largest.
void Flood(const cv::Mat& states, const cv::Mat& cloud, const cv::Mat& bend, const ClusterParams& params, cv::Mat& labels) {
  std::array<std::vector<std::pair<cv::Point, int>>, 181> waiting;  // By bend.
  const auto offer = [&](const cv::Point& from, int level) {
    const float z = cloud.at<cv::Vec3f>(from)[2];
    for (const cv::Point& direction : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
      const int steps = StepsToNext(states, from, direction, params.bridge_px);
      const cv::Point to = from + steps * direction;
      if (labels.at<int>(to) != 0 || states.at<std::uint8_t>(to) < kAbove) continue;
      if (!OnOneSurface(z, cloud.at<cv::Vec3f>(to)[2], steps, params)) continue;
      waiting[std::max(level, static_cast<int>(bend.at<float>(to)))].emplace_back(to, labels.at<int>(from));
    }
  };
  // The surfaces' pixels beside creases begin.
  const cv::Point steps_4[] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      if (labels.at<int>(y, x) != 0 || states.at<std::uint8_t>(y, x) < kAbove) continue;
      for (const cv::Point& direction : steps_4) {
        const int steps = StepsToNext(states, {x, y}, direction, params.bridge_px);
        if (steps > 0 && labels.at<int>(cv::Point(x, y) + steps * direction) != 0) offer(cv::Point(x, y) + steps * direction, 0);
      }
    }
  }
  for (int level = 0; level < static_cast<int>(waiting.size()); ++level) {
    for (std::size_t i = 0; i < waiting[level].size(); ++i) {  // It may grow.
      const auto [pixel, label] = waiting[level][i];
      if (labels.at<int>(pixel) != 0) continue;
      labels.at<int>(pixel) = label;
      offer(pixel, level);
    }
  }
}

// --- Which creases part objects ---

struct Surface {
  int pixels = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double squares = 0.0;
  void Add(const Surface& other) { pixels += other.pixels, sum += other.sum, squares += other.squares; }
  // The diagonal of the box over which so many points would be spread.
  double Size_m() const {
    const double variance = squares / pixels - (sum / pixels).squaredNorm();
    return std::sqrt(12.0 * std::max(0.0, variance));
  }
};

struct Border {
  int pixels = 0;
  double bend_deg = 0.0;  // Summed over them.
  double length_m = 0.0;
  void Add(const Border& other) { pixels += other.pixels, bend_deg += other.bend_deg, length_m += other.length_m; }
};

using Pair = std::pair<int, int>;  // Of labels, the lower first.
Pair PairOf(int a, int b) { return {std::min(a, b), std::max(a, b)}; }

struct Neighbours {
  std::vector<Surface> surfaces;  // By label.
  std::map<Pair, Border> borders;
};

Neighbours Gather(const cv::Mat& labels, int count, const cv::Mat& states, const cv::Mat& cloud, const cv::Mat& bend,
                  double focal_px, const ClusterParams& params) {
  Neighbours result;
  result.surfaces.resize(count + 1);
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      const int a = labels.at<int>(y, x);
      if (a == 0) continue;
      const cv::Vec3f& p = cloud.at<cv::Vec3f>(y, x);
      const Eigen::Vector3d point(p[0], p[1], p[2]);
      result.surfaces[a].Add({1, point, point.squaredNorm()});
      for (const cv::Point& direction : {cv::Point(1, 0), cv::Point(0, 1)}) {
        const int steps = StepsToNext(states, {x, y}, direction, params.bridge_px);
        const cv::Point to = cv::Point(x, y) + steps * direction;
        const int b = labels.at<int>(to);
        if (b == 0 || b == a || !OnOneSurface(p[2], cloud.at<cv::Vec3f>(to)[2], steps, params)) continue;
        result.borders[PairOf(a, b)].Add({1, std::max(bend.at<float>(y, x), bend.at<float>(to)), p[2] / focal_px});
      }
    }
  }
  return result;
}

// From 1 on the evidence keeps the two apart.
double Evidence(const Border& border, const Surface& a, const Surface& b, const ClusterParams& params) {
  const Surface& smaller = a.pixels < b.pixels ? a : b;
  const double size_m = smaller.Size_m();
  return std::min({border.bend_deg / border.pixels / params.min_crease_deg, size_m / params.min_part_m,
                   border.length_m / (params.min_crease_share * size_m), smaller.pixels / static_cast<double>(params.min_pixels)});
}

// Joins what little keeps apart, the least first. Returns each label's owner.
std::vector<int> JoinWeak(const ClusterParams& params, Neighbours& neighbours) {
  std::vector<int> owners(neighbours.surfaces.size());
  std::iota(owners.begin(), owners.end(), 0);
  std::vector<Surface>& surfaces = neighbours.surfaces;
  for (;;) {
    Pair weakest;
    double least = 1.0;
    for (const auto& [pair, border] : neighbours.borders) {
      const double evidence = Evidence(border, surfaces[pair.first], surfaces[pair.second], params);
      if (evidence < least) least = evidence, weakest = pair;
    }
    if (least >= 1.0) return owners;
    const auto [into, gone] = weakest;
    surfaces[into].Add(surfaces[gone]);
    for (int& owner : owners)
      if (owner == gone) owner = into;
    std::map<Pair, Border> borders;
    for (const auto& [pair, border] : neighbours.borders) {
      const int a = owners[pair.first], b = owners[pair.second];
      if (a != b) borders[PairOf(a, b)].Add(border);
    }
    neighbours.borders = std::move(borders);
  }
}

}  // namespace

cv::Mat InwardBend(const cv::Mat& states, const cv::Mat& cloud, const geometry::PinholeCamera& camera,
                   const ClusterParams& params) {
  const Terrain terrain = TerrainOf(states, cloud, camera, params);
  const int pace = std::max(1, static_cast<int>(std::lround(camera.fx / kFocalPerPace_px)));
  cv::Mat bend(states.size(), CV_32FC1, cv::Scalar(0));
  for (int y = 0; y < states.rows; y += pace)
    for (int x = 0; x < states.cols; x += pace) bend.at<float>(y, x) = BendAt(terrain, x, y, params);
  if (pace == 1) return bend;
  // Between these only where one of them bends at all: most surfaces are flat.
  cv::Mat near_bent;
  cv::dilate(bend > kFlat_deg, near_bent, cv::Mat::ones(2 * pace - 1, 2 * pace - 1, CV_8UC1));
  for (int y = 0; y < states.rows; ++y)
    for (int x = 0; x < states.cols; ++x)
      if (near_bent.at<std::uint8_t>(y, x) && (y % pace || x % pace)) bend.at<float>(y, x) = BendAt(terrain, x, y, params);
  return bend;
}

Surfaces PartAtCreases(const cv::Mat& states, const cv::Mat& cloud, const geometry::PinholeCamera& camera,
                       const ClusterParams& params) {
  const cv::Mat bend = InwardBend(states, cloud, camera, params);
  const cv::Mat marked = MarkCreases(states, bend, camera);
  Surfaces result;
  int count = Components(marked, cloud, params, &result.labels);
  count = KeepSeeds(count, result.labels);
  Flood(marked, cloud, bend, params, result.labels);
  Neighbours neighbours = Gather(result.labels, count, states, cloud, bend, camera.fx, params);
  const std::vector<int> owners = JoinWeak(params, neighbours);
  std::vector<int> names(count + 1, 0);
  int left = 0;
  for (int i = 1; i <= count; ++i) names[i] = owners[i] == i ? ++left : names[owners[i]];
  Rename(names, result.labels);
  result.count = left;
  for (const auto& [pair, border] : neighbours.borders) result.in_crease.insert(PairOf(names[pair.first], names[pair.second]));
  return result;
}

}  // namespace vantage::segmentation
