#include "config/yaml.h"

#include <gtest/gtest.h>

#include <fstream>

namespace vantage::config {
namespace {

// What the error says; empty where nothing is thrown.
template <typename Action>
std::string ErrorOf(const Action& action) {
  try {
    action();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

template <typename Value>
std::string GetError(const std::string& text) {
  return ErrorOf([&] {
    Value value{};
    Mapping::Parse(text, "a.yaml").Get("key", value);
  });
}

TEST(Yaml, ReadsEveryType) {
  Mapping mapping = Mapping::Parse(
      "truth: true\ncount: -3\nseed: 4294967295\nlength_m: 1.5e-2\nname: cracker box\nsize_m: [1, 2.5, -3]\n"
      "angles: [0, 90]\nmeshes: [a.obj, \"b.obj\"]\n",
      "a.yaml");
  bool truth = false;
  int count = 0;
  std::uint32_t seed = 0;
  double length_m = 0;
  std::string name;
  Eigen::Vector3d size_m = Eigen::Vector3d::Zero();
  std::vector<double> angles;
  std::vector<std::string> meshes;
  mapping.Get("truth", truth);
  mapping.Get("count", count);
  mapping.Get("seed", seed);
  mapping.Get("length_m", length_m);
  mapping.Get("name", name);
  mapping.Get("size_m", size_m);
  mapping.Get("angles", angles);
  mapping.Get("meshes", meshes);
  EXPECT_NO_THROW(mapping.Finish());
  EXPECT_TRUE(truth);
  EXPECT_EQ(count, -3);
  EXPECT_EQ(seed, 4294967295u);
  EXPECT_DOUBLE_EQ(length_m, 0.015);
  EXPECT_EQ(name, "cracker box");
  EXPECT_EQ(size_m, Eigen::Vector3d(1, 2.5, -3));
  EXPECT_EQ(angles, (std::vector<double>{0, 90}));
  EXPECT_EQ(meshes, (std::vector<std::string>{"a.obj", "b.obj"}));
}

TEST(Yaml, AbsentKeysLeaveTheDefault) {
  Mapping mapping = Mapping::Parse("", "a.yaml");
  double value = 7;
  mapping.Get("key", value);
  EXPECT_EQ(value, 7);
  EXPECT_FALSE(mapping.Has("key"));
  Mapping child = mapping.Child("child");
  child.Get("key", value);
  EXPECT_EQ(value, 7);
  EXPECT_TRUE(mapping.Children("children").empty());
  EXPECT_NO_THROW(child.Finish());
  EXPECT_NO_THROW(mapping.Finish());
}

TEST(Yaml, WrongTypesNameFileLineKeyAndValue) {
  EXPECT_EQ(GetError<bool>("\nkey: yes"), "a.yaml:2: key must be true or false, is 'yes'");
  EXPECT_EQ(GetError<int>("key: 1.5"), "a.yaml:1: key must be an integer, is '1.5'");
  EXPECT_EQ(GetError<int>("key: \"15\""), "a.yaml:1: key must be an integer, is '15'");
  EXPECT_EQ(GetError<int>("key:"), "a.yaml:1: key must be an integer, is nothing");
  EXPECT_EQ(GetError<int>("key: 99999999999"), "a.yaml:1: key must be an integer, is '99999999999'");
  EXPECT_NE(GetError<std::uint32_t>("key: -1"), "");
  EXPECT_EQ(GetError<double>("# note\n\nkey: far"), "a.yaml:3: key must be a finite number, is 'far'");
  EXPECT_NE(GetError<double>("key: nan"), "");
  EXPECT_NE(GetError<double>("key: inf"), "");
  EXPECT_NE(GetError<double>("key: 0x10"), "");
  EXPECT_EQ(GetError<std::string>("key: [a]"), "a.yaml:1: key must be a text, is a list of 1");
  EXPECT_EQ(GetError<Eigen::Vector3d>("key: [1, 2]"), "a.yaml:1: key must be a list of 3 finite numbers, is a list of 2");
  EXPECT_NE(GetError<std::vector<double>>("key: [1, two]"), "");
  EXPECT_NE(GetError<std::vector<std::string>>("key: a"), "");
}

TEST(Yaml, AFailedGetLeavesTheValue) {
  Mapping mapping = Mapping::Parse("key: [1, two]", "a.yaml");
  std::vector<double> value{5};
  EXPECT_THROW(mapping.Get("key", value), std::runtime_error);
  EXPECT_EQ(value, std::vector<double>{5});
}

TEST(Yaml, UnknownKeysAreRefusedWithTheKnownOnes) {
  Mapping mapping = Mapping::Parse("rate_hz: 10\nworth: 3\nzebra: 1\n", "config/a.yaml");
  double value = 0;
  mapping.Get("rate_hz", value);
  mapping.Get("worth_s", value);
  EXPECT_EQ(ErrorOf([&] { mapping.Finish(); }), "config/a.yaml:2: unknown key 'worth'; known keys: rate_hz, worth_s");
}

TEST(Yaml, ChildrenCheckThemselves) {
  Mapping mapping =
      Mapping::Parse("camera:\n  width: 640\n  hight: 480\nobjects:\n  - {name: a}\n  - name: b\n    size: 1\n", "a.yaml");
  Mapping camera = mapping.Child("camera");
  int width = 0;
  camera.Get("width", width);
  EXPECT_EQ(width, 640);
  EXPECT_EQ(ErrorOf([&] { camera.Finish(); }), "a.yaml:3: unknown key 'hight'; known keys: width");
  std::vector<Mapping> objects = mapping.Children("objects");
  ASSERT_EQ(objects.size(), 2u);
  std::string name;
  objects[0].Get("name", name);
  EXPECT_EQ(name, "a");
  EXPECT_NO_THROW(objects[0].Finish());
  objects[1].Get("name", name);
  EXPECT_EQ(name, "b");
  EXPECT_EQ(ErrorOf([&] { objects[1].Finish(); }), "a.yaml:7: unknown key 'size'; known keys: name");
  EXPECT_NO_THROW(mapping.Finish());
}

TEST(Yaml, WrongShapesAreRefused) {
  EXPECT_EQ(ErrorOf([] { Mapping::Parse("- a\n- b\n", "a.yaml"); }),
            "a.yaml:1: expected a mapping (key: value), found a list of 2");
  EXPECT_EQ(ErrorOf([] { Mapping::Parse("a: 1\nb: 2\na: 3\n", "a.yaml"); }), "a.yaml:3: key 'a' was given already in line 1");
  EXPECT_EQ(ErrorOf([] { Mapping::Parse("b: 1\na: 4", "a.yaml").Child("a"); }),
            "a.yaml:2: expected a mapping (key: value), found '4'");
  EXPECT_EQ(ErrorOf([] { Mapping::Parse("a: {b: 1}", "a.yaml").Children("a"); }),
            "a.yaml:1: a must be a list of mappings, is a mapping");
  EXPECT_NE(ErrorOf([] { Mapping::Parse("a: [1]", "a.yaml").Children("a"); }), "");
  EXPECT_NE(ErrorOf([] { Mapping::Parse("a: 1\n---\nb: 2\n", "a.yaml"); }), "");
  EXPECT_EQ(ErrorOf([] { Mapping::Parse("a: 1\nb: [1, 2\n", "a.yaml"); }).rfind("a.yaml:", 0), 0u);
}

TEST(Yaml, MissingFilesAreNamed) {
  EXPECT_EQ(ErrorOf([] { Mapping::Load("/nowhere/at/all.yaml"); }).rfind("/nowhere/at/all.yaml: cannot open", 0), 0u);
  EXPECT_NE(ErrorOf([] { Mapping::Load("/"); }).find("folder"), std::string::npos);
}

TEST(Yaml, LoadReadsAFile) {
  const std::filesystem::path file = std::filesystem::path(testing::TempDir()) / "vantage_yaml_test.yaml";
  std::ofstream(file) << "key: 3\n";
  int value = 0;
  Mapping::Load(file).Get("key", value);
  EXPECT_EQ(value, 3);
  std::filesystem::remove(file);
}

struct RateParams {
  double rate_hz = 10;
  void Check() const {
    if (!(rate_hz > 0)) throw std::invalid_argument("rate_hz must be > 0, is " + std::to_string(rate_hz));
  }
};

TEST(Yaml, RangesAreCheckedWhereTheyWereRead) {
  Mapping mapping = Mapping::Parse("sensor:\n  rate_hz: -1\n", "a.yaml");
  Mapping sensor = mapping.Child("sensor");
  RateParams params;
  sensor.Get("rate_hz", params.rate_hz);
  EXPECT_EQ(ErrorOf([&] { sensor.Check(params); }), "a.yaml:2: rate_hz must be > 0, is -1.000000");
  EXPECT_EQ(ErrorOf([&] { sensor.Fail("rate_hz", "is odd"); }), "a.yaml:2: rate_hz: is odd");
}

}  // namespace
}  // namespace vantage::config
