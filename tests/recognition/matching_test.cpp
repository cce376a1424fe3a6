#include "recognition/matching.h"

#include <gtest/gtest.h>

#include <set>

#include "recognition/descriptors.h"
#include "support/temp_folder.h"

namespace vantage::recognition {
namespace {

constexpr int kPoints = 60;  // Of a view.

// A view per entry of `seeds`, each of points of its own.
std::shared_ptr<model::ObjectModel> MakeObject(const std::string& name, const std::vector<std::uint32_t>& seeds) {
  auto object = std::make_shared<model::ObjectModel>();
  object->name = name;
  std::mt19937 random(1);
  for (std::size_t v = 0; v < seeds.size(); ++v) {
    model::View view;
    view.id = static_cast<int>(v);
    view.T_camera_object.translation().z() = 0.7;
    view.keyframe.camera = {100, 100, 500, 500, 49.5, 49.5};
    view.features.descriptors = RandomUnitRows(kPoints, seeds[v]);
    for (int k = 0; k < kPoints; ++k) {
      view.features.keypoints.emplace_back(static_cast<float>(k), 50.f, 4.f);
      view.points.push_back(static_cast<int>(object->points.size()));
      const auto coordinate = [&] { return random() / 4294967296.0 - 0.5; };
      object->points.push_back({{coordinate(), coordinate(), coordinate()}, Eigen::Vector3d::UnitZ()});
    }
    object->views.push_back(view);
  }
  return object;
}

// Points of each of these views, seen again, and as many of nothing known.
features::Features FrameWith(const std::vector<std::uint32_t>& seeds) {
  features::Features features;
  for (const std::uint32_t seed : seeds) {
    features.descriptors.push_back(SeenAgain(RandomUnitRows(kPoints, seed), 0.3, seed));
    features.descriptors.push_back(RandomUnitRows(kPoints, 100000 + seed));
  }
  features.keypoints.resize(features.descriptors.rows);
  return features;
}

MatchingParams Tree(int exhaustive_points) {
  MatchingParams params;
  params.exhaustive_points = exhaustive_points;
  return params;
}

// Seeds of views: 10 * object + view.
std::string NameOf(int object) { return "object " + std::to_string(object); }
void Fill(Matcher& matcher, int objects) {
  for (int o = 0; o < objects; ++o) matcher.Set(MakeObject(NameOf(o), {10u * o + 1, 10u * o + 2}));
}

const ObjectMatches* Find(const std::vector<ObjectMatches>& found, const std::string& name) {
  for (const ObjectMatches& object : found) {
    if (object.known->object->name == name) return &object;
  }
  return nullptr;
}

// Of the matches, those of the frame's first block of points with the same points of the view.
int Right(const ObjectMatches& object, int view) {
  int right = 0;
  for (const Tentative& match : object.matches) {
    const Entry& entry = object.known->entries[match.row];
    right += entry.view == view && entry.keypoint == match.keypoint;
  }
  return right;
}

TEST(Matcher, ByTheTreeAsByComparingAll) {
  for (const int exhaustive_points : {100000, 500}) {
    Matcher matcher(Tree(exhaustive_points), "sift");
    Fill(matcher, 40);
    EXPECT_EQ(matcher.exhaustive(), exhaustive_points > 500);
    const auto found = matcher.Match(FrameWith({72}));
    const ObjectMatches* object = Find(found, NameOf(7));
    ASSERT_NE(object, nullptr);
    EXPECT_GT(Right(*object, 1), 50);
    EXPECT_LT(static_cast<int>(object->matches.size()), 70);
    if (!matcher.exhaustive()) {
      EXPECT_EQ(object, &found[0]) << "the most likely comes first";
    }
  }
}

TEST(Matcher, OnlyCandidatesGoOn) {
  MatchingParams params = Tree(0);
  params.max_candidates = 3;
  for (const char* ranking : {"distance", "score"}) {
    params.ranking = ranking;
    params.max_leaf_points = 20;  // For the score: words that tell objects apart.
    Matcher matcher(params, "sift");
    Fill(matcher, 40);
    const auto found = matcher.Match(FrameWith({72, 151, 301}));
    EXPECT_LE(found.size(), 3u);
    for (const int object : {7, 15, 30}) EXPECT_NE(Find(found, NameOf(object)), nullptr) << ranking << " " << object;
  }
}

TEST(Matcher, FollowsObjectsThatGrowChangeAndGo) {
  Matcher matcher(Tree(500), "sift");
  Fill(matcher, 20);
  matcher.Set(MakeObject(NameOf(4), {41, 42, 999}));
  auto found = matcher.Match(FrameWith({999}));
  ASSERT_NE(Find(found, NameOf(4)), nullptr);
  EXPECT_GT(Right(*Find(found, NameOf(4)), 2), 50);
  found = matcher.Match(FrameWith({41}));
  EXPECT_GT(Right(*Find(found, NameOf(4)), 0), 50) << "the views it had are still there";

  matcher.Set(MakeObject(NameOf(4), {999, 42}));  // The first view was replaced, the third went.
  found = matcher.Match(FrameWith({999}));
  EXPECT_GT(Right(*Find(found, NameOf(4)), 0), 50);
  found = matcher.Match(FrameWith({41}));
  EXPECT_EQ(Find(found, NameOf(4)), nullptr);

  matcher.Remove(NameOf(4));
  matcher.Remove("nobody");
  EXPECT_EQ(matcher.size(), 19);
  found = matcher.Match(FrameWith({999}));
  EXPECT_EQ(Find(found, NameOf(4)), nullptr);
  matcher.Set(MakeObject("newcomer", {777}));
  found = matcher.Match(FrameWith({777}));
  ASSERT_NE(Find(found, "newcomer"), nullptr);
  EXPECT_GT(Right(*Find(found, "newcomer"), 0), 50);

  for (int o = 0; o < 20; ++o) matcher.Remove(NameOf(o));
  EXPECT_TRUE(matcher.exhaustive());
  EXPECT_GT(Right(matcher.Match(FrameWith({777}))[0], 0), 50);
  matcher.Remove("newcomer");
  EXPECT_TRUE(matcher.Match(FrameWith({777})).empty());
}

TEST(Matcher, AFrameWithoutPointsAndAnObjectWithoutPoints) {
  for (const int exhaustive_points : {100000, 0}) {
    Matcher matcher(Tree(exhaustive_points), "sift");
    EXPECT_TRUE(matcher.Match(FrameWith({1})).empty());
    matcher.Set(MakeObject("bare", {}));
    matcher.Set(MakeObject("one", {1}));
    features::Features nothing;
    nothing.descriptors = cv::Mat(0, kLength, CV_32F);
    for (const ObjectMatches& object : matcher.Match(nothing)) EXPECT_TRUE(object.matches.empty());
    const auto found = matcher.Match(FrameWith({1}));
    ASSERT_NE(Find(found, "one"), nullptr) << "one object, one view";
    EXPECT_GT(Right(*Find(found, "one"), 0), 40);
  }
}

TEST(Matcher, StartsFromAStockVocabularyOfItsOwnFeatures) {
  const vantage::testing::TempFolder folder;
  MatchingParams params = Tree(0);
  params.vocabulary = (folder / "stock.voc").string();
  EXPECT_NE(ErrorOf([&] { Matcher(params, "sift"); }).find("stock.voc: expected a vocabulary file"), std::string::npos);
  VocabularyTree::Train("sift", RandomUnitRows(3000, 1), SmallTree()).Save(params.vocabulary);
  const std::string error = ErrorOf([&] { Matcher(params, "surf"); });
  EXPECT_NE(error.find("expected a vocabulary of surf descriptors, found one of sift descriptors of 64 values"), std::string::npos)
      << error;
  Matcher matcher(params, "sift");
  Fill(matcher, 20);
  const auto found = matcher.Match(FrameWith({72}));
  ASSERT_NE(Find(found, NameOf(7)), nullptr);
  EXPECT_GT(Right(*Find(found, NameOf(7)), 1), 50);
}

TEST(MatchingParams, OutOfRangeIsNamed) {
  MatchingParams params;
  params.ranking = "size";
  EXPECT_NE(ErrorOf([&] { params.Check(); }).find("ranking"), std::string::npos);
  params = MatchingParams();
  params.neighbours = 1;
  EXPECT_NE(ErrorOf([&] { params.Check(); }).find("neighbours"), std::string::npos);
}

}  // namespace
}  // namespace vantage::recognition
