#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera/board.h"
#include "calib/camera/picture_list.h"
#include "perch/camera/camera_model.h"

namespace perch {

struct FindOptions {
  std::optional<CameraModel> lens;  // what is known of it; only a landing target of squares asks
  bool cache = true;                // beside the pictures; not with a lens, which the corners would depend on
  std::filesystem::path show;       // a folder for pictures with their corners; empty: none
  size_t most_frames = 60;          // of one sequence: more add little beside their time
  const std::atomic<bool>* stop = nullptr;
};

// 0 to 1 and what is being done. Called from several threads, one at a time. May be empty.
using FindProgress = std::function<void(double, const std::string&)>;

struct LeftOut {
  std::string picture, reason;
};

struct FoundBoards {
  BoardViews views;               // median sigma 1, so that mrcal's regularisation weighs what it is meant to
  std::vector<LeftOut> left_out;  // pictures of no use, and why
  std::vector<std::string> remarks;  // caches that could not be used, files cut short
};

// Looks for the board in all pictures, on all cores. Left out, with the reason: what cannot be read, has
// another size than most, shows no board, or is blurred so much more than the others that its corners are of
// no use; a picture blurred a little is given less weight. Of a sequence the sharpest frame of every few is
// looked at, and of those with the board the ones that differ most are taken. Throws std::runtime_error when
// no picture shows the board, with what chessboard was seen instead if there is one.
FoundBoards find_boards(const Board& board, const PictureList& pictures, const FindOptions& options,
                        const FindProgress& progress = {});

}  // namespace perch
