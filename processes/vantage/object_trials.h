// Virtual trials of a stored object: what they are pasted over, and a file that keeps them.
#pragma once

#include <string>
#include <vector>

#include "assessment/assessor.h"
#include "common/params.h"
#include "model/store.h"

namespace vantage::cli {

// At most 32 of the folder's images, or where that is empty of the object's own keyframes, itself masked; and some of these with
// another object of the store in them. Throws std::runtime_error where the folder holds no image.
std::vector<assessment::Background> BackgroundsFor(const model::ObjectModel& object, const std::string& folder,
                                                   const model::Store& store);

// `params.trials.trials_per_view` a view. Progress on standard error.
std::vector<assessment::Trial> RunObjectTrials(const model::ObjectModel& object, std::vector<assessment::Background>* backgrounds,
                                               const params::LibraryParams& params);

// About `images` virtual images of the object: view by view, each with those before it as the
// assessor process has them, and each in `file` before the next. What is there already, with these parameters and this folder, is
// not run again: a view that has enough keeps all it has. Progress on standard error.
std::vector<assessment::Trial> KeptObjectTrials(const std::string& file, const model::ObjectModel& object,
                                                const std::string& folder, std::vector<assessment::Background>* backgrounds,
                                                int images, const params::LibraryParams& params);

}  // namespace vantage::cli
