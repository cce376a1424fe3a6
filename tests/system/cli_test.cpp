// Drives the real `vantage` program: results, and one clear line for every bad input.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "support/data.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

std::string ReadFile(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

struct Outcome {
  int code = -1;
  std::string out;
  std::string err;
};

class Cli : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) /
              ("vantage_cli_" + std::to_string(::getpid()) + "_" + ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  // Runs `vantage ARGUMENTS` in the test's folder.
  Outcome Run(const std::string& arguments) const {
    const std::string command = "cd '" + folder_.string() + "' && '" VANTAGE_PROGRAM "' " + arguments + " >.out 2>.err </dev/null";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, ReadFile(folder_ / ".out"), ReadFile(folder_ / ".err")};
  }

  // Exit code 1 and one line on standard error that starts with who says it and holds every one of the parts.
  void ExpectRefused(const std::string& arguments, const std::string& who, const std::vector<std::string>& parts) const {
    SCOPED_TRACE("vantage " + arguments);
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.code, 1);
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(outcome.err.rfind(who + ": ", 0), 0u) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    for (const std::string& part : parts)
      EXPECT_NE(outcome.err.find(part), std::string::npos) << "no '" << part << "' in " << outcome.err;
  }

  // What is in the folder beside what the tests made, by name.
  std::vector<std::string> Files() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_)) {
      const std::string name = entry.path().filename().string();
      if (name != ".out" && name != ".err") names.push_back(name);
    }
    std::sort(names.begin(), names.end());
    return names;
  }

  // A scene folder of three plain frames: readable, with nothing in them to learn.
  fs::path MakeScene(const std::string& name) const {
    const fs::path scene = folder_ / name;
    Json cameras;
    for (int id = 0; id < 3; ++id) {
      char file[16];
      std::snprintf(file, sizeof(file), "%06d", id);
      for (const char* part : {"rgb", "depth"}) fs::create_directories(scene / part);
      cv::imwrite((scene / "rgb" / file).string() + ".png", cv::Mat(48, 64, CV_8UC3, cv::Scalar(90, 120, 150)));
      cv::imwrite((scene / "depth" / file).string() + ".png", cv::Mat(48, 64, CV_16UC1, cv::Scalar(800)));
      cameras[std::to_string(id)] = {{"cam_K", {60, 0, 32, 0, 60, 24, 0, 0, 1}}, {"depth_scale", 1.0}};
    }
    std::ofstream(scene / "scene_camera.json") << cameras;
    return scene;
  }

  void Write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }

  fs::path folder_;
};

TEST_F(Cli, HelpAndVersionOfEveryVerb) {
  for (const char* verb : {"",
                           "learn",
                           "recognise",
                           "assess",
                           "explore",
                           "calibrate",
                           "evaluate calibration",
                           "evaluate features",
                           "evaluate learner",
                           "evaluate recogniser",
                           "evaluate segmentation",
                           "log info",
                           "log verify",
                           "log cut",
                           "log filter",
                           "log export",
                           "models list",
                           "models show",
                           "replay",
                           "truth",
                           "vocabulary train",
                           "vocabulary show"}) {
    SCOPED_TRACE(verb);
    const Outcome help = Run(std::string(verb) + " --help");
    EXPECT_EQ(help.code, 0);
    EXPECT_EQ(help.err, "");
    EXPECT_NE(help.out.find("--version"), std::string::npos);
    if (*verb != 0) {
      EXPECT_NE(help.out.find("--seed"), std::string::npos);
      EXPECT_NE(help.out.find("--json FILE|-"), std::string::npos);
    }
    const Outcome version = Run(std::string(verb) + " --version");
    EXPECT_EQ(version.code, 0);
    EXPECT_EQ(version.out.rfind("vantage 0.", 0), 0u) << version.out;
  }
}

TEST_F(Cli, MisuseIsOneLine) {
  ExpectRefused("", "vantage", {"--help"});
  ExpectRefused("lern", "vantage", {"lern"});
  ExpectRefused("learn", "vantage learn", {"--sequence"});
  ExpectRefused("learn --sequence a --store b --colour red", "vantage learn", {"--colour"});
  ExpectRefused("learn --sequence a --store b --seed -1", "vantage learn", {"seed"});
  ExpectRefused("learn --sequence a --store b --object-pixel 5", "vantage learn", {"object-pixel"});
  ExpectRefused("learn --sequence a --store b --object-pixel 5,6 --object-id 3", "vantage learn", {"object-id"});
  ExpectRefused("recognise --sequence a", "vantage recognise", {"--store"});
  ExpectRefused("models", "vantage models", {});
  ExpectRefused("log", "vantage log", {});
  ExpectRefused("log info gone.lcm", "vantage log info", {"gone.lcm"});
  ExpectRefused("log cut gone.lcm", "vantage log cut", {"--out"});
  ExpectRefused("replay gone.lcm --out a.lcm", "vantage replay", {"gone.lcm"});
  ExpectRefused("replay gone.lcm", "vantage replay", {"--out"});
  ExpectRefused("replay gone.lcm --out a.lcm --processes learner,gardener", "vantage replay", {"gardener", "recogniser"});
  ExpectRefused("log export gone.lcm", "vantage log export", {"--bop", "--csv"});
  ExpectRefused("models show --store a", "vantage models show", {"object"});
  ExpectRefused("vocabulary train --out a", "vantage vocabulary train", {"images"});
  ExpectRefused("explore", "vantage explore", {"--sequence", "--world", "--mesh"});
  ExpectRefused("explore --sequence a", "vantage explore", {"--object-id"});
  ExpectRefused("explore --world w.yaml --strategy best", "vantage explore", {"best"});
  ExpectRefused("evaluate", "vantage evaluate", {});
  ExpectRefused("evaluate calibration", "vantage evaluate calibration", {"--sequence"});
  ExpectRefused("evaluate calibration --sequence gone --object-id 3", "vantage evaluate calibration", {"gone"});
  ExpectRefused("evaluate calibration --sequence a --object-id 3 --store b --draws 2", "vantage evaluate calibration",
                {"--draws", "--store"});
  ExpectRefused("evaluate features --sequence gone --object-id 3", "vantage evaluate features", {"gone"});
  ExpectRefused("evaluate features --sequence gone --object-id 3 --features sift:3000", "vantage evaluate features",
                {"TYPE:MAX_KEYPOINTS:CONTRAST", "sift:3000"});
  ExpectRefused("evaluate learner", "vantage evaluate learner", {"--mesh", "--world"});
  ExpectRefused("evaluate learner --mesh gone", "vantage evaluate learner", {"gone", "textured.obj"});
  ExpectRefused("evaluate learner --mesh a --passes 2", "vantage evaluate learner", {"--passes", "--sequence"});
  ExpectRefused("evaluate learner --mesh gone --fault tired", "vantage evaluate learner", {"tired", "covered"});
  ExpectRefused("evaluate recogniser", "vantage evaluate recogniser", {"--world", "--absent"});
  ExpectRefused("evaluate recogniser --absent a,b", "vantage evaluate recogniser", {"--store"});
  ExpectRefused("evaluate recogniser --store gone.db --absent a", "vantage evaluate recogniser", {"gone.db"});
  ExpectRefused("evaluate recogniser --world gone.yaml", "vantage evaluate recogniser", {"gone.yaml"});
  EXPECT_TRUE(Files().empty());
}

TEST_F(Cli, MissingAndBrokenRecordings) {
  ExpectRefused("learn --sequence nowhere --store a.db", "vantage learn", {"nowhere"});
  fs::create_directories(folder_ / "empty");
  ExpectRefused("learn --sequence empty --store a.db", "vantage learn", {"empty", "scene_camera.json"});

  const fs::path broken = MakeScene("broken");
  std::ofstream(broken / "scene_camera.json") << "{\"0\": {";
  ExpectRefused("learn --sequence broken --store a.db", "vantage learn", {"scene_camera.json"});

  const fs::path gap = MakeScene("gap");
  fs::remove(gap / "depth" / "000000.png");
  ExpectRefused("learn --sequence gap --store a.db", "vantage learn", {"000000.png"});

  const fs::path small = MakeScene("small");
  cv::imwrite((small / "depth" / "000000.png").string(), cv::Mat(24, 32, CV_16UC1, cv::Scalar(800)));
  ExpectRefused("learn --sequence small --store a.db --json a.json", "vantage learn", {"000000.png", "64", "32"});

  const fs::path garbled = MakeScene("garbled");
  std::ofstream(garbled / "rgb" / "000000.png") << "no image";
  ExpectRefused("learn --sequence garbled --store a.db", "vantage learn", {"000000.png"});
  EXPECT_EQ(Files(), (std::vector<std::string>{"broken", "empty", "gap", "garbled", "small"})) << "nothing was half written";
}

TEST_F(Cli, NothingToLearnLeavesNothing) {
  MakeScene("plain");
  ExpectRefused("learn --sequence plain --store a.db --json a.json", "vantage learn", {"plain", "no object"});
  ExpectRefused("learn --sequence plain --store a.db --frames some", "vantage learn", {"some"});
  ExpectRefused("learn --sequence plain --store a.db --frames 7:9", "vantage learn", {"7:9"});
  ExpectRefused("learn --sequence plain --store a.db --object-id 3", "vantage learn", {"scene_gt.json", "3"});
  ExpectRefused("learn --sequence plain --store a.db --use-known-poses", "vantage learn", {"plain", "--use-known-poses"});
  ExpectRefused("explore --sequence plain --object-id 3", "vantage explore", {"scene_gt.json", "3"});
  EXPECT_EQ(Files(), std::vector<std::string>{"plain"});
}

TEST_F(Cli, ConfigurationErrorsNameFileAndLine) {
  MakeScene("plain");
  Write("a.yaml", "learner:\n  min_view_pionts: 3\n");
  ExpectRefused("learn --sequence plain --store a.db --config a.yaml", "vantage learn",
                {"a.yaml:2: unknown key 'min_view_pionts'"});
  Write("b.yaml", "recogniser:\n  matching: {max_ratio: 7}\n");
  ExpectRefused("learn --sequence plain --store a.db --config b.yaml", "vantage learn", {"b.yaml:2: ", "max_ratio"});
  Write("c.yaml", "recogniser: [\n");
  ExpectRefused("learn --sequence plain --store a.db --config c.yaml", "vantage learn", {"c.yaml:"});
  ExpectRefused("learn --sequence plain --store a.db --config d.yaml", "vantage learn", {"d.yaml"});
  EXPECT_FALSE(fs::exists(folder_ / "a.db"));
}

TEST_F(Cli, StoresThatAreNone) {
  MakeScene("plain");
  Write("notes.txt", std::string(4000, 'x'));
  ExpectRefused("learn --sequence plain --store notes.txt", "vantage learn", {"notes.txt", "not a model store"});
  ExpectRefused("recognise --sequence plain --store notes.txt", "vantage recognise", {"notes.txt", "not a model store"});
  ExpectRefused("models list --store notes.txt", "vantage models list", {"notes.txt", "not a model store"});
  ExpectRefused("assess --store notes.txt", "vantage assess", {"notes.txt", "not a model store"});
  EXPECT_EQ(ReadFile(folder_ / "notes.txt"), std::string(4000, 'x'));
  ExpectRefused("recognise --sequence plain --store none.db", "vantage recognise", {"none.db", "no such store"});
  ExpectRefused("assess --store none.db", "vantage assess", {"none.db", "no such store"});
  ExpectRefused("assess --store none.db --predict mug --from 0,0,1", "vantage assess", {"none.db", "no such store"});
  ExpectRefused("assess --store none.db --predict mug", "vantage assess", {"--predict", "--from"});
  ExpectRefused("models show box --store none.db", "vantage models show", {"none.db", "no such store"});
  ExpectRefused("learn --sequence plain --store none/a.db", "vantage learn", {"none"});
  ExpectRefused("learn --sequence plain --store plain", "vantage learn", {"plain", "folder"});
  EXPECT_EQ(Files(), (std::vector<std::string>{"notes.txt", "plain"}));
}

TEST_F(Cli, ResultsThatCannotBeWritten) {
  MakeScene("plain");
  ExpectRefused("learn --sequence plain --store a.db --json none/a.json", "vantage learn", {"none/a.json"});
  ExpectRefused("learn --sequence plain --store a.db --json plain", "vantage learn", {"plain", "folder"});
  EXPECT_EQ(Files(), std::vector<std::string>{"plain"});
}

TEST_F(Cli, WorldsThatAreNone) {
  ExpectRefused("explore --world none.yaml", "vantage explore", {"none.yaml"});
  Write("w.yaml", "table_size_x_m: 1.0\nroof: red\n");
  ExpectRefused("explore --world w.yaml", "vantage explore", {"w.yaml:2", "roof"});
  ExpectRefused("explore --mesh none.obj", "vantage explore", {"none.obj"});
}

// Removes what depends on the clock.
Json WithoutTimes(Json result) {
  for (const char* key : {"ms", "ms_median", "ms_per_frame_median", "ms_per_frame_p95"}) result.erase(key);
  for (auto& frame : result["frames"].is_array() ? result["frames"] : Json::array()) frame.erase("ms");
  return result;
}

TEST_F(Cli, LearnsRecognisesAndShows) {
  VANTAGE_NEEDS_DATA("ycbv");
  const std::string sequence = "--sequence '" + (testing::DataFolder() / "ycbv").string() + "' ";
  const std::string learn = "learn " + sequence + "--object-id 9 --object gelatin --use-known-poses --json - --store ";
  const Outcome learned = Run(learn + "a.db");
  ASSERT_EQ(learned.code, 0) << learned.err;
  EXPECT_EQ(learned.err, "");
  const Json result = Json::parse(learned.out);
  EXPECT_EQ(result.at("frames"), 10);
  EXPECT_GE(result.at("views"), 1);
  EXPECT_GE(result.at("points"), 20);
  EXPECT_GT(result.at("ms_per_frame_median"), 0.0);
  for (const char* key : {"tracked", "ms_per_frame_p95", "lost", "translation_error_mm_median", "rotation_error_deg_median"}) {
    EXPECT_TRUE(result.contains(key)) << key;
  }

  const Outcome again = Run(learn + "b.db");
  Json second = WithoutTimes(Json::parse(again.out));
  second["store"] = "a.db";
  EXPECT_EQ(WithoutTimes(result), second) << "same seed, same result";
  EXPECT_EQ(Run(learn + "a.db").code, 0) << "an object can be learned anew";

  const Outcome found = Run("recognise " + sequence + "--store a.db --frames 1:4 --json found.json --bop found.csv");
  ASSERT_EQ(found.code, 0) << found.err;
  const Json frames = Json::parse(ReadFile(folder_ / "found.json")).at("frames");
  ASSERT_EQ(frames.size(), 3u);
  ASSERT_EQ(frames[0].at("detections").size(), 1u);
  const Json& detection = frames[0]["detections"][0];
  EXPECT_EQ(detection.at("object"), "gelatin");
  ASSERT_EQ(detection.at("T_camera_object").size(), 16u);
  EXPECT_NEAR(detection["T_camera_object"][11].get<double>(), 1.0, 0.7) << "metres along the optical axis";
  EXPECT_EQ(detection["T_camera_object"][15], 1.0);
  EXPECT_GT(detection.at("confidence"), 0.3);
  EXPECT_GT(detection.at("probability"), 0.5);
  std::istringstream csv(ReadFile(folder_ / "found.csv"));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line, "scene_id,im_id,obj_id,score,R,t,time");
  std::getline(csv, line);
  EXPECT_EQ(std::count(line.begin(), line.end(), ','), 6) << line;
  EXPECT_EQ(std::count(line.begin(), line.end(), ' '), 8 + 2) << line;

  const Json list = Json::parse(Run("models list --store a.db --json -").out);
  ASSERT_EQ(list.at("objects").size(), 1u);
  EXPECT_EQ(list["objects"][0].at("name"), "gelatin");
  EXPECT_TRUE(list["objects"][0].at("completeness").is_null());
  const Json show = Json::parse(Run("models show gelatin --store a.db --json -").out);
  EXPECT_EQ(show.at("views").size(), result.at("views"));
  ExpectRefused("models show mug --store a.db", "vantage models show", {"a.db", "mug"});
  EXPECT_EQ(Files(), (std::vector<std::string>{"a.db", "b.db", "found.csv", "found.json"}))
      << "stores are one file each when closed";
}

// The shipped table of four boxes: learned from few views, found in one frame; what was learned is kept, and is not in a picture of
// nothing.
TEST_F(Cli, TheRecogniserIsHeldAgainstATable) {
  const Outcome outcome = Run("evaluate recogniser --quick --world '" VANTAGE_SOURCE_DIR
                              "/config/worlds/table.yaml' --store t.db --save pictures --json -");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json clutter = Json::parse(outcome.out)["clutter"];
  EXPECT_EQ(clutter["objects"], 4);
  EXPECT_EQ(clutter["frames"], 1);
  EXPECT_GE(clutter["right_in_start_frame"], 3);
  EXPECT_EQ(clutter["all"]["wrong"], 0);
  EXPECT_GE(clutter["occlusion"].size(), 4u);
  EXPECT_FALSE(cv::imread((folder_ / "pictures" / "overlay_0_0.png").string()).empty());

  MakeScene("plain");
  const Outcome absent = Run("evaluate recogniser --store t.db --absent plain --json -");
  ASSERT_EQ(absent.code, 0) << absent.err;
  EXPECT_EQ(Json::parse(absent.out)["absent"]["frames"], 3);
  EXPECT_EQ(Json::parse(absent.out)["absent"]["objects"], 4);
  EXPECT_EQ(Json::parse(absent.out)["absent"]["detections"], 0);
}

TEST_F(Cli, SegmentationIsHeldAgainstLabelsAndThePlainMethod) {
  const fs::path bare = MakeScene("bare");
  ExpectRefused("evaluate segmentation --sequence bare", "vantage evaluate segmentation", {"bare", "label"});
  VANTAGE_NEEDS_DATA("osd");
  const Outcome outcome =
      Run("evaluate segmentation --sequence '" + (testing::DataFolder() / "osd").string() + "' --save pictures --json -");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json figures = Json::parse(outcome.out);
  const Json &apart = figures.at("apart"), &rest = figures.at("rest");
  EXPECT_EQ(apart.at("clusters").at("objects"), 38);
  EXPECT_EQ(apart.at("clusters").at("found"), 38);
  EXPECT_EQ(rest.at("clusters").at("images"), 28);
  EXPECT_GE(rest.at("clusters").at("found").get<int>(), 66) << rest;  // Of 74.
  EXPECT_GT(rest.at("clusters").at("found").get<int>(), rest.at("plain").at("found").get<int>());
  for (const char* sum : {"images", "objects", "found"}) {
    EXPECT_EQ(rest.at("clusters").at(sum).get<int>(),
              figures.at("rest_even").at("clusters").at(sum).get<int>() + figures.at("rest_odd").at("clusters").at(sum).get<int>());
  }
  EXPECT_EQ(cv::imread((folder_ / "pictures" / "000044.png").string()).size(), cv::Size(3 * 640, 480));
}

TEST_F(Cli, AVocabularyIsTrainedAndShown) {
  fs::create_directories(folder_ / "photos" / "more");
  cv::RNG random(7);
  for (const char* name : {"photos/b.png", "photos/a.jpg", "photos/more/c.png"}) {
    cv::Mat image(240, 320, CV_8UC1);
    random.fill(image, cv::RNG::UNIFORM, 0, 255);
    cv::blur(image, image, {5, 5});
    cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
    cv::imwrite((folder_ / name).string(), image);
  }
  Write("photos/notes.txt", "no image");
  const Outcome trained = Run("vocabulary train photos --out a.voc --branching 4 --depth 3 --json -");
  ASSERT_EQ(trained.code, 0) << trained.err;
  EXPECT_NE(trained.err.find("training: 100 %"), std::string::npos) << trained.err;
  const Json result = Json::parse(trained.out);
  EXPECT_EQ(result.at("images"), 3);
  EXPECT_GT(result.at("leaves"), 30);
  EXPECT_LE(result.at("leaves"), 64);
  EXPECT_EQ(result.at("trained_with"), result.at("descriptors"));
  EXPECT_EQ(Run("vocabulary train photos --out b.voc --branching 4 --depth 3 --max-descriptors 200").code, 0);
  const Json shown = Json::parse(Run("vocabulary show a.voc --json -").out);
  EXPECT_EQ(shown.at("leaves"), result.at("leaves"));
  EXPECT_EQ(shown.at("descriptor"), "sift");
  EXPECT_EQ(shown.at("length"), 128);

  const std::string whole = ReadFile(folder_ / "a.voc");
  Write("a.voc", whole.substr(0, whole.size() / 2));
  ExpectRefused("vocabulary show a.voc", "vantage vocabulary show", {"a.voc", "damaged", "vantage vocabulary train"});
  ExpectRefused("vocabulary show photos/notes.txt", "vantage vocabulary show", {"photos/notes.txt", "expected a vocabulary file"});
  ExpectRefused("vocabulary train none --out c.voc", "vantage vocabulary train", {"none"});
  ExpectRefused("vocabulary train photos/notes.txt --out c.voc", "vantage vocabulary train", {"notes.txt", "expected an image"});
  ExpectRefused("vocabulary train photos --branching 1 --out c.voc", "vantage vocabulary train", {"branching"});
  ExpectRefused("vocabulary train photos --out none/c.voc", "vantage vocabulary train", {"none"});
  fs::create_directories(folder_ / "empty");
  ExpectRefused("vocabulary train empty --out c.voc", "vantage vocabulary train", {"empty", "found none"});
  cv::imwrite((folder_ / "empty" / "grey.png").string(), cv::Mat(48, 64, CV_8UC1, cv::Scalar(90)));
  EXPECT_NE(Run("vocabulary train empty --out c.voc").err.find("no interest points"), std::string::npos);
  EXPECT_EQ(Files(), (std::vector<std::string>{"a.voc", "b.voc", "empty", "photos"}));
}

TEST_F(Cli, AssessmentGoesOnWhereItWasStoppedAndPredicts) {
  VANTAGE_NEEDS_DATA("ycbv");
  const std::string data = fs::absolute(testing::DataFolder()).string();
  Outcome outcome = Run("learn --sequence '" + data + "/ycbv' --object-id 9 --frames 1:2 --use-known-poses --store s.db");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string name = Json::parse(Run("models list --store s.db --json -").out)["objects"][0]["name"];
  outcome = Run("assess --store s.db --images 14 --json first.json");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("virtual images"), std::string::npos) << outcome.err;
  // As after a crash: the last line is cut off, and what came before counts.
  std::ofstream(folder_ / "s.db.trials", std::ios::app) << "{\"key\": \"";
  outcome = Run("assess --store s.db --images 14 --json again.json");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_EQ(ReadFile(folder_ / "first.json"), ReadFile(folder_ / "again.json"));
  // What is kept for more images is enough for fewer, but not with other parameters.
  EXPECT_EQ(Run("assess --store s.db --images 12").err, "");
  std::ofstream(folder_ / "other.yaml") << "trials:\n  max_blur_px: 0.5\n";
  EXPECT_NE(Run("assess --store s.db --images 12 --config other.yaml").err, "");
  // From where it was learned, and from behind.
  const Json shown = Json::parse(Run("models show '" + name + "' --store s.db --json -").out);
  const Json& T = shown["views"][0]["T_camera_object"];  // Row-major; the camera is at -R^T t.
  double place[3];
  for (int i = 0; i < 3; ++i) {
    place[i] = 0.0;
    for (int k = 0; k < 3; ++k)
      place[i] -= T[static_cast<std::size_t>(4 * k + i)].get<double>() * T[static_cast<std::size_t>(4 * k + 3)].get<double>();
  }
  const auto predict = [&](double sign) {
    std::ostringstream arguments;
    arguments << "assess --store s.db --predict '" << name << "' --json - --from=" << sign * place[0] << ',' << sign * place[1]
              << ',' << sign * place[2];
    const Outcome answer = Run(arguments.str());
    EXPECT_EQ(answer.code, 0) << answer.err;
    return Json::parse(answer.out);
  };
  EXPECT_GT(predict(1.0)["probability"], 0.5);
  EXPECT_LT(predict(1.0)["rotation_deg"], 0.1);
  EXPECT_EQ(predict(-1.0)["probability"], 0.0);
  EXPECT_EQ(predict(1.0)["source"], "own");
  // The report, with photographs as truth; the second time nothing is tried again. The store stays as it is.
  const std::string before = ReadFile(folder_ / "s.db");
  const std::string report =
      "assess --store s.db --report report --images 30 --sequence '" + data + "/ycbv' --object-id 9 --frames ";
  outcome = Run(report + "2:6 --json report.json");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string page = ReadFile(folder_ / "report" / "index.html");
  EXPECT_NE(page.find("<td>" + name + "</td>"), std::string::npos);
  EXPECT_NE(page.find("</html>"), std::string::npos);
  const Json observations = Json::parse(ReadFile(folder_ / "report.json"))["observations"];
  EXPECT_EQ(observations.size(), 11u);  // 6 of virtual images, 5 of photographs; one object alone cannot differ from others.
  for (const Json& one : observations) EXPECT_FALSE(one["why"].get<std::string>().empty()) << one["claim"];
  EXPECT_EQ(Run(report + "2:6").err, "");
  ExpectRefused(report + "1:6", "vantage assess", {"learned from frame 1", "--frames"});
  EXPECT_EQ(ReadFile(folder_ / "s.db"), before);
}

}  // namespace
}  // namespace vantage
