// vantage vocabulary: stock vocabularies for recognition with many objects.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <set>
#include <sstream>

#include "features/features.h"
#include "recognition/vocabulary_tree.h"
#include "vantage/verb.h"

namespace vantage::cli {
namespace {

namespace fs = std::filesystem;

struct VocabularyOptions {
  CommonOptions common;
  std::vector<std::string> images;
  std::string out;
  std::string file;
  recognition::VocabularyParams tree;
  int max_descriptors = 2000000;
};

bool IsImage(const fs::path& file) {
  static const std::set<std::string> endings = {".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".tif", ".tiff"};
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return endings.count(ending) > 0;
}

// Files as named; of folders, every image in and below them, by name.
std::vector<fs::path> ImageFiles(const std::vector<std::string>& names) {
  std::vector<fs::path> files;
  for (const std::string& name : names) {
    if (!fs::is_directory(name)) {
      files.emplace_back(name);
      continue;
    }
    std::vector<fs::path> inside;
    for (const auto& entry : fs::recursive_directory_iterator(name)) {
      if (entry.is_regular_file() && IsImage(entry.path())) inside.push_back(entry.path());
    }
    if (inside.empty()) throw std::runtime_error(name + ": expected images (png, jpg, ...) in the folder, found none");
    std::sort(inside.begin(), inside.end());
    files.insert(files.end(), inside.begin(), inside.end());
  }
  return files;
}

// Keeps an even choice of all rows it is given (Vitter's algorithm R).
class Reservoir {
 public:
  Reservoir(int most, std::uint32_t seed) : most_(static_cast<std::size_t>(most)), random_(seed) {}

  void Add(const cv::Mat& descriptors) {
    for (int row = 0; row < descriptors.rows; ++row) {
      const std::size_t at =
          seen_++ < most_ ? seen_ - 1 : static_cast<std::size_t>(random_() / 4294967296.0 * static_cast<double>(seen_));
      if (at >= most_) continue;
      if (at < static_cast<std::size_t>(kept_.rows)) {
        descriptors.row(row).copyTo(kept_.row(static_cast<int>(at)));
      } else {
        kept_.push_back(descriptors.row(row));
      }
    }
  }
  const cv::Mat& kept() const { return kept_; }
  std::size_t seen() const { return seen_; }

 private:
  std::size_t most_;
  std::mt19937 random_;
  std::size_t seen_ = 0;
  cv::Mat kept_;
};

// On standard error, whenever another tenth is done.
class Progress {
 public:
  explicit Progress(const char* what) : what_(what) {}
  void operator()(double share) {
    const int tenth = static_cast<int>(share * 10.0);
    if (tenth <= tenth_) return;
    tenth_ = tenth;
    std::fprintf(stderr, "%s: %d %%\n", what_, 10 * tenth);
  }

 private:
  const char* what_;
  int tenth_ = 0;
};

Json Describe(const recognition::VocabularyTree& tree) {
  Json result;
  result["descriptor"] = tree.descriptor();
  result["length"] = tree.length();
  result["branching"] = tree.params().branching;
  result["depth"] = tree.params().depth;
  result["leaves"] = tree.leaves();
  result["memory_bytes"] = tree.memory_bytes();
  return result;
}

std::string Summary(const recognition::VocabularyTree& tree) {
  std::ostringstream text;
  text.precision(3);
  text << tree.leaves() << " leaves of " << tree.descriptor() << " descriptors of " << tree.length() << " values, "
       << static_cast<double>(tree.memory_bytes()) / 1e6 << " MB in memory\n";
  return text.str();
}

void RunTrain(VocabularyOptions options) {
  CheckOutput(options.common);
  CheckWritable(options.out);
  options.tree.seed = options.common.seed;
  options.tree.Check();
  const features::FeatureParams params = LoadParams(options.common).recogniser.features;
  const std::vector<fs::path> files = ImageFiles(options.images);
  Reservoir reservoir(options.max_descriptors, options.common.seed);
  Progress extracting("extracting");
  for (std::size_t i = 0; i < files.size(); ++i) {
    const cv::Mat image = cv::imread(files[i].string(), cv::IMREAD_GRAYSCALE);
    if (image.empty()) throw std::runtime_error(files[i].string() + ": expected an image, found none that can be read");
    reservoir.Add(features::Extract(image, cv::Mat(), params).descriptors);
    extracting(static_cast<double>(i + 1) / static_cast<double>(files.size()));
  }
  if (reservoir.seen() == 0) throw std::runtime_error("the images have no interest points; a vocabulary needs images with texture");
  const auto tree = recognition::VocabularyTree::Train(params.type, reservoir.kept(), options.tree, Progress("training"));
  tree.Save(options.out);

  Json result = Describe(tree);
  result["images"] = files.size();
  result["descriptors"] = reservoir.seen();
  result["trained_with"] = reservoir.kept().rows;
  std::ostringstream summary;
  summary << options.out << ": " << files.size() << " images, " << reservoir.seen() << " descriptors (" << reservoir.kept().rows
          << " used); " << Summary(tree);
  WriteResult(options.common, result, summary.str());
}

void RunShow(const VocabularyOptions& options) {
  CheckOutput(options.common);
  const auto tree = recognition::VocabularyTree::Load(options.file);
  WriteResult(options.common, Describe(tree), options.file + ": " + Summary(tree));
}

}  // namespace

void AddVocabulary(CLI::App& app, Run& run) {
  CLI::App* verb = app.add_subcommand("vocabulary", "Stock vocabularies, which recognition with many objects starts from");
  verb->require_subcommand(1);
  auto options = std::make_shared<VocabularyOptions>();
  CLI::App* train = verb->add_subcommand("train", "Make a vocabulary from images by hierarchical k-means");
  AddCommonOptions(*train, options->common);
  train->add_option("--images,images", options->images, "Image files, or folders with images in or below them")
      ->required()
      ->check(CLI::ExistingPath)
      ->type_name("IMAGES");
  train->add_option("--out", options->out, "The vocabulary file; replaced where there is one")->required()->type_name("FILE");
  train->add_option("--branching", options->tree.branching, "Children of a node")->capture_default_str();
  train->add_option("--depth", options->tree.depth, "Levels of nodes; at most branching^depth leaves")->capture_default_str();
  train->add_option("--max-descriptors", options->max_descriptors, "Train with an even choice of so many; bounds the memory")
      ->capture_default_str()
      ->check(CLI::Range(1, 50000000));
  train->callback([options, &run] { run = [options] { RunTrain(*options); }; });
  CLI::App* show = verb->add_subcommand("show", "What a vocabulary file holds");
  AddCommonOptions(*show, options->common);
  show->add_option("--file,file", options->file, "The vocabulary file")->required()->type_name("FILE");
  show->callback([options, &run] { run = [options] { RunShow(*options); }; });
}

}  // namespace vantage::cli
