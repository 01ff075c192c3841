#include "calib/camera/board_finder.h"

namespace perch {

std::unique_ptr<BoardFinder> make_board_finder(const Board& board, const std::optional<CameraModel>& lens) {
  if (const auto* chessboard = std::get_if<Chessboard>(&board.pattern))
    return make_chessboard_finder(*chessboard);
  if (const auto* charuco = std::get_if<CharucoBoard>(&board.pattern)) return make_charuco_finder(*charuco);
  const auto& target = std::get<TargetBoard>(board.pattern);
  if (target.edges.edges.empty()) return make_tags_finder(target);
  return make_squares_finder(target, lens);
}

}  // namespace perch
