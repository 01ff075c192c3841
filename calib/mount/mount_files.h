#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "calib/mount/cross_validation.h"

namespace perch {

// The calibrated chain as perch-batch takes it: body_from_base, world_from_pad of the first flight,
// time_offset; a head's axes with their zeros. A head's zero of the first axis is its turn from the drawing's
// mount, that of the second one what makes the first axis stand upright in the picture.
FrameChain calibrated_chain(const FrameChain& configured, const MountProblem& problem,
                            const MountSolution& solution);

// The text of mount.yaml: the `frames` section, deviations in comments.
std::string mount_yaml(const FrameChain& chain, const MountProblem& problem, const MountSolution& solution);

nlohmann::ordered_json mount_json(const FrameChain& chain, const MountProblem& problem,
                                  const MountSolution& solution, const std::vector<HeldOut>& held_out);

}  // namespace perch
