// The library's parameter structs from YAML: keys are the names of the fields, nested structs are nested mappings.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "assessment/assessor.h"
#include "config/yaml.h"
#include "exploration/planner.h"
#include "learning/learner.h"
#include "motion/mount.h"
#include "recognition/recogniser.h"

namespace vantage::params {

// Each reads one mapping: absent keys leave the value, unknown keys and values out of range throw std::runtime_error "FILE:LINE:
// ...".
void Read(config::Mapping mapping, recognition::RecogniserParams& params);
// All but params.recogniser, which has a mapping of its own.
void Read(config::Mapping mapping, learning::LearnerParams& params);
void Read(config::Mapping mapping, assessment::TrialParams& params);
void Read(config::Mapping mapping, exploration::PlannerParams& params);
void Read(config::Mapping mapping, exploration::CandidateParams& params);
void Read(config::Mapping mapping, motion::MountParams& params);

// What the command line and the processes share, as in config/library.yaml.
struct LibraryParams {
  recognition::RecogniserParams recogniser;
  learning::LearnerParams learner;  // learner.recogniser is the one above.
  assessment::TrialParams trials;
  exploration::PlannerParams planner;
  exploration::CandidateParams candidates;
  motion::MountParams mount;
  // File of `vantage calibrate --hand-eye` that says where the camera sits on the mount, instead of camera_position_m and
  // camera_rotation_rad of mount.arm (LoadLibraryParams puts it there) and of the mount process; empty: they count.
  std::string hand_eye;
};

// The sections present in the mapping, which may hold others: the caller calls Finish.
void ReadSections(config::Mapping& mapping, LibraryParams& params);
// mount.arm.urdf and hand_eye, where they are relative, are relative to the file's folder.
LibraryParams LoadLibraryParams(const std::filesystem::path& file);

// Every value as text by its dotted key, such as "recogniser.ransac.inlier_px": for logs and comparisons.
std::map<std::string, std::string> Flatten(const LibraryParams& params);

}  // namespace vantage::params
