// The names of all LCM channels. The README of each process says which it uses.
#pragma once

#include <string>

namespace vantage::messaging {

inline constexpr char kSensorColor[] = "SENSOR_COLOR";                    // image_part_t
inline constexpr char kSensorDepth[] = "SENSOR_DEPTH";                    // image_part_t
inline constexpr char kMountState[] = "MOUNT_STATE";                      // mount_state_t
inline constexpr char kMountCommand[] = "MOUNT_COMMAND";                  // mount_command_t
inline constexpr char kLearnerTrack[] = "LEARNER_TRACK";                  // track_t
inline constexpr char kLearnerScene[] = "LEARNER_SCENE";                  // scene_t
inline constexpr char kLearnerView[] = "LEARNER_VIEW";                    // view_t
inline constexpr char kRecogniserDetections[] = "RECOGNISER_DETECTIONS";  // detections_t
inline constexpr char kAssessorMeasures[] = "ASSESSOR_MEASURES";          // measures_t
inline constexpr char kAssessorCompleteness[] = "ASSESSOR_COMPLETENESS";  // completeness_t
inline constexpr char kAssessorQuery[] = "ASSESSOR_QUERY";                // query_t
inline constexpr char kAssessorAnswer[] = "ASSESSOR_ANSWER";              // answer_t
inline constexpr char kPlannerPlan[] = "PLANNER_PLAN";                    // plan_t
inline constexpr char kPlannerReach[] = "PLANNER_REACH";                  // reach_t
inline constexpr char kOperatorCommand[] = "OPERATOR_COMMAND";            // operator_command_t
inline constexpr char kObjectPrior[] = "OBJECT_PRIOR";                    // object_prior_t
inline constexpr char kLinkClock[] = "LINK_CLOCK";                        // host_clock_t
inline constexpr char kLinkQuery[] = "LINK_QUERY";                        // store_query_t
inline constexpr char kLinkList[] = "LINK_LIST";                          // store_list_t
inline constexpr char kLinkPart[] = "LINK_PART";                          // store_part_t

// The status channel of a process: "learner" -> "LEARNER_STATUS" (status_t).
std::string StatusChannel(const std::string& process);

}  // namespace vantage::messaging
