#include <gtest/gtest.h>

#include <fstream>
#include <set>

#include "recognition/descriptors.h"
#include "recognition/inverted_file.h"
#include "recognition/kmeans.h"
#include "recognition/vocabulary_tree.h"
#include "support/temp_folder.h"

namespace vantage::recognition {
namespace {

TEST(KMeans, PackedCentroidsAgreeWithTheDefinition) {
  for (const int count : {2, 15, 16, 17, 40}) {
    const cv::Mat centroids = RandomUnitRows(count, 1, 31) * 0.7, rows = RandomUnitRows(9, 2, 31);
    std::vector<float> packed(PackedFloats(count, 31));
    PackCentroids(centroids.ptr<float>(), count, 31, packed.data());
    std::vector<const float*> pointers;
    for (int r = 0; r < rows.rows; ++r) pointers.push_back(rows.ptr<float>(r));
    std::vector<int> nearest(rows.rows);
    AssignToCentroids(packed.data(), count, 31, pointers.data(), pointers.size(), nearest.data());
    for (int r = 0; r < rows.rows; ++r) {
      int best = 0;
      for (int c = 1; c < count; ++c) {
        if (cv::norm(rows.row(r), centroids.row(c)) < cv::norm(rows.row(r), centroids.row(best))) best = c;
      }
      EXPECT_EQ(nearest[r], best);
    }
    cv::Mat back(count, 31, CV_32F);
    UnpackCentroids(packed.data(), count, 31, back.ptr<float>());
    EXPECT_EQ(cv::norm(back, centroids), 0.0);
  }
}

TEST(KMeans, FindsWellPartedGroups) {
  const cv::Mat centres = RandomUnitRows(5, 3);
  cv::Mat rows;
  for (std::uint32_t i = 0; i < 20; ++i) rows.push_back(SeenAgain(centres, 0.05, i));
  std::vector<const float*> pointers;
  for (int r = 0; r < rows.rows; ++r) pointers.push_back(rows.ptr<float>(r));
  KMeansParams params;
  params.clusters = 5;
  std::mt19937 random(1);
  std::vector<float> found = KMeans(pointers.data(), pointers.size(), kLength, params, random);
  ASSERT_EQ(found.size(), 5u * kLength);
  const cv::Mat means(5, kLength, CV_32F, found.data());
  for (int c = 0; c < 5; ++c) {
    double nearest = 2.0;
    for (int f = 0; f < 5; ++f) nearest = std::min(nearest, cv::norm(centres.row(c), means.row(f)));
    EXPECT_LT(nearest, 0.05);
  }
}

TEST(VocabularyTree, TrainingMakesTheLeavesAskedFor) {
  const VocabularyTree tree = VocabularyTree::Train("sift", RandomUnitRows(4000, 1), SmallTree());
  EXPECT_LE(tree.leaves(), 64);
  EXPECT_GE(tree.leaves(), 60);
  EXPECT_EQ(tree.leaves() + (tree.leaves() - 1) / 3, tree.nodes()) << "inner nodes have four children";
}

TEST(VocabularyTree, QuantiseFollowsTheNearestCentroidAndMorePathsFindMore) {
  const cv::Mat rows = RandomUnitRows(4000, 1), again = SeenAgain(rows.rowRange(0, 500), 0.25, 9);
  const VocabularyTree tree = VocabularyTree::Train("sift", rows, SmallTree());
  const Words first = tree.Quantise(rows.rowRange(0, 500)), seen = tree.Quantise(again), beam = tree.Quantise(again, 6);
  int same = 0, within = 0;
  for (int r = 0; r < 500; ++r) {
    same += first.of(r)[0] == seen.of(r)[0];
    within += std::find(beam.of(r), beam.of(r) + 6, first.of(r)[0]) != beam.of(r) + 6;
    EXPECT_EQ(std::set<int>(beam.of(r), beam.of(r) + 6).size(), 6u) << "leaves of one row differ";
  }
  EXPECT_GT(same, 200);
  EXPECT_GT(within, 450);
  EXPECT_GT(within, same);
}

TEST(VocabularyTree, AFewRowsAndEqualRowsAreOneLeaf) {
  EXPECT_EQ(VocabularyTree::Train("sift", RandomUnitRows(1, 1), SmallTree()).leaves(), 1);
  EXPECT_EQ(VocabularyTree::Train("sift", cv::repeat(RandomUnitRows(1, 1), 100, 1), SmallTree()).leaves(), 1);
  EXPECT_EQ(VocabularyTree("sift", kLength, SmallTree()).Quantise(RandomUnitRows(3, 1)).leaves, (std::vector<int>{0, 0, 0}));
  EXPECT_EQ(VocabularyTree("sift", kLength, SmallTree()).Quantise(cv::Mat()).rows(), 0);
}

TEST(VocabularyTree, SameSeedSameTree) {
  const cv::Mat rows = RandomUnitRows(3000, 1), query = RandomUnitRows(200, 2);
  const VocabularyTree a = VocabularyTree::Train("sift", rows, SmallTree()), b = VocabularyTree::Train("sift", rows, SmallTree());
  EXPECT_EQ(a.Quantise(query, 3).leaves, b.Quantise(query, 3).leaves);
  VocabularyParams other = SmallTree();
  other.seed = 6;
  EXPECT_NE(a.Quantise(query).leaves, VocabularyTree::Train("sift", rows, other).Quantise(query).leaves);
}

TEST(VocabularyTree, ASplitMovesNoOtherLeaf) {
  const cv::Mat rows = RandomUnitRows(2000, 1);
  VocabularyTree tree = VocabularyTree::Train("sift", rows, SmallTree());
  const std::vector<int> before = tree.Quantise(rows).leaves;
  const int split = before[0];
  cv::Mat inside;
  for (int r = 0; r < rows.rows; ++r) {
    if (before[r] == split) inside.push_back(rows.row(r));
  }
  const int node = tree.Split(split, inside.rowRange(0, inside.rows / 2));
  ASSERT_GE(node, 0);
  const std::vector<int> parts = tree.LeavesUnder(node, inside);
  ASSERT_EQ(static_cast<int>(parts.size()), inside.rows);
  EXPECT_EQ(tree.Quantise(inside).leaves, parts);
  const std::vector<int> after = tree.Quantise(rows).leaves;
  for (int r = 0; r < rows.rows; ++r) {
    if (before[r] != split) {
      EXPECT_EQ(after[r], before[r]);
    }
  }
  EXPECT_EQ(tree.leaves(), 1 + *std::max_element(after.begin(), after.end())) << "numbers have no gaps";
}

TEST(VocabularyTree, RowsOfAnotherLengthAreRefused) {
  const VocabularyTree tree("sift", 128, SmallTree());
  const std::string error = ErrorOf([&] { tree.Quantise(RandomUnitRows(2, 1, 96)); });
  EXPECT_NE(error.find("128"), std::string::npos) << error;
  EXPECT_NE(error.find("96"), std::string::npos) << error;
}

TEST(VocabularyParams, OutOfRangeIsNamed) {
  VocabularyParams params;
  params.branching = 1;
  EXPECT_NE(ErrorOf([&] { params.Check(); }).find("branching"), std::string::npos);
  InvertedFileParams file;
  file.background_documents = 0.0;
  EXPECT_NE(ErrorOf([&] { file.Check(); }).find("background_documents"), std::string::npos);
}

// --- Saving and loading.

class VocabularyFile : public ::testing::Test {
 protected:
  const vantage::testing::TempFolder folder_;
  const std::filesystem::path file_ = folder_.path() / "words.voc";
  const VocabularyTree tree_ = VocabularyTree::Train("sift", RandomUnitRows(3000, 1), SmallTree());

  std::string Bytes() const {
    std::ifstream stream(file_, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(stream), {});
  }
  void Write(const std::string& bytes) const { std::ofstream(file_, std::ios::binary) << bytes; }
  std::string LoadError() const {
    return ErrorOf([&] { VocabularyTree::Load(file_, "sift", kLength); });
  }
};

TEST_F(VocabularyFile, LoadsAsItWasSaved) {
  tree_.Save(file_);
  VocabularyTree loaded = VocabularyTree::Load(file_, "sift", kLength);
  const cv::Mat query = RandomUnitRows(300, 2);
  EXPECT_EQ(loaded.leaves(), tree_.leaves());
  EXPECT_EQ(loaded.descriptor(), "sift");
  EXPECT_EQ(loaded.Quantise(query, 4).leaves, tree_.Quantise(query, 4).leaves);
  loaded.Save(folder_.path() / "again.voc");
  std::ifstream again(folder_.path() / "again.voc", std::ios::binary);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(again), {}), Bytes());
  EXPECT_GE(loaded.Split(0, RandomUnitRows(50, 3)), 0) << "it grows on";
}

TEST_F(VocabularyFile, EveryTruncationAndEveryFlippedByteIsFound) {
  tree_.Save(file_);
  const std::string whole = Bytes();
  for (std::size_t size = 0; size < whole.size(); size += size < 100 ? 1 : 997) {
    Write(whole.substr(0, size));
    const std::string error = LoadError();
    ASSERT_EQ(error.find(file_.string() + ": "), 0u) << size << ": " << error;
    ASSERT_NE(error.find("vantage vocabulary train"), std::string::npos) << size;
    ASSERT_EQ(error.find('\n'), std::string::npos);
  }
  for (std::size_t at = 0; at < whole.size(); at += at < 200 ? 1 : 499) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x41);
    Write(damaged);
    ASSERT_NE(LoadError(), "") << "byte " << at;
  }
  Write(whole + "x");
  EXPECT_NE(LoadError().find("damaged"), std::string::npos);
  Write(whole);
  EXPECT_EQ(LoadError(), "");
}

TEST_F(VocabularyFile, AnotherDescriptorIsOneClearLine) {
  VocabularyTree("surf", 32, SmallTree()).Save(file_);
  const std::string error = LoadError();
  EXPECT_NE(error.find("expected a vocabulary of sift descriptors of 64 values, found one of surf descriptors of 32 values"),
            std::string::npos)
      << error;
}

TEST_F(VocabularyFile, NoFileAFolderAndAForeignFile) {
  EXPECT_NE(LoadError().find("found none"), std::string::npos);
  EXPECT_NE(ErrorOf([&] { VocabularyTree::Load(folder_.path()); }).find("found none"), std::string::npos);
  Write("this is a letter, not a vocabulary, and long enough for a header");
  EXPECT_NE(LoadError().find("found something else"), std::string::npos);
}

TEST_F(VocabularyFile, WhereItCannotBeWrittenTheOldOneStays) {
  EXPECT_NE(ErrorOf([&] { tree_.Save(folder_.path() / "nowhere" / "words.voc"); }).find("could not be written"), std::string::npos);
  tree_.Save(file_);
  EXPECT_FALSE(std::filesystem::exists(file_.string() + ".part"));
}

}  // namespace
}  // namespace vantage::recognition
