#include "calib/camera/find_boards.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <mutex>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "calib/camera/corner_cache.h"
#include "calib/camera/frame_choice.h"
#include "calib/camera/show_corners.h"
#include "perch/camera/image_source.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

// A picture blurred by more than this part of the others' median is left out, if it is blurred by more than
// this. Twice the median keeps one in which the camera shook by a pixel, at half the weight.
constexpr double kBlurOfOthers = 2, kBlurPx = 1.2;

// Of each frame that is taken of a sequence so many are looked at, and of each that is looked at many more
// are seen.
constexpr int64_t kLookedAt = 4;
constexpr int64_t kWindowOfUnknown = 5;  // frames, where nobody knows how many there are
constexpr size_t kBatch = 16;            // frames in memory

// One still picture, or a frame with its pixels.
struct Looked {
  FoundBoard board;
  cv::Mat grey;  // of a frame of a sequence
};

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

class Search {
 public:
  Search(const Board& board, const FindOptions& options, const FindProgress& progress)
      : board_(board), options_(options), progress_(progress), cache_(board.text), finders_([this] {
          return make_board_finder(board_, options_.lens);
        }) {
    finders_.local();  // what is wrong with the board is said before any thread starts
  }

  void stills(const std::vector<fs::path>& files);
  void sequence(const std::string& source);
  FoundBoards result();

 private:
  void check_stop() const {
    if (options_.stop && *options_.stop) throw std::runtime_error("interrupted");
  }
  bool uses_cache() const { return options_.cache && !options_.lens; }
  FoundBoard look(const Frame& frame, const std::string& picture, const fs::path& file);
  void look_at(const std::vector<Frame>& frames, const fs::path& file, std::vector<Looked>& found);
  void told(double part, const std::string& what) {
    const std::lock_guard lock(mutex_);
    if (progress_) progress_(part, what);
  }
  std::vector<size_t> sharp_and_distinct(const std::vector<Looked>& found) const;
  void leave_out_sizes();
  void leave_out_blurred();
  void show() const;
  std::string what_else(const std::vector<LeftOut>& without) const;

  const Board& board_;
  const FindOptions& options_;
  const FindProgress& progress_;
  CornerCache cache_;
  tbb::enumerable_thread_specific<std::unique_ptr<BoardFinder>> finders_;
  std::mutex mutex_;
  std::vector<Looked> kept_;
  FoundBoards result_;
};

FoundBoard Search::look(const Frame& frame, const std::string& picture, const fs::path& file) {
  FoundBoard found{picture, frame.grey.cols, frame.grey.rows, {}};
  if (!frame.problem.empty()) {
    found.sighting.problem = frame.problem;
    return found;
  }
  found.sighting = finders_.local()->find(frame.grey);
  if (uses_cache()) cache_.keep(file, picture, found);
  return found;
}

void Search::stills(const std::vector<fs::path>& files) {
  std::vector<FoundBoard> found(files.size());
  std::atomic<size_t> done = 0;
  tbb::parallel_for(size_t{0}, files.size(), [&](size_t i) {
    if (options_.stop && *options_.stop) return;
    const std::string name = files[i].string();
    const auto known = uses_cache() ? cache_.find(files[i], name) : std::nullopt;
    if (known) {
      found[i] = *known;
    } else {
      Frame frame;
      read_picture(files[i], Channel::kGrey, frame);
      found[i] = look(frame, name, files[i]);
    }
    told(static_cast<double>(++done) / static_cast<double>(files.size()), "looking for the board");
  });
  check_stop();
  for (FoundBoard& board : found) kept_.push_back({std::move(board), {}});
}

void Search::look_at(const std::vector<Frame>& frames, const fs::path& file, std::vector<Looked>& found) {
  const size_t before = found.size();
  found.resize(before + frames.size());
  tbb::parallel_for(size_t{0}, frames.size(), [&](size_t i) {
    // A flight's pictures are files of their own, if they are not the frames of a video.
    const bool of_video = frames[i].name.find('#') != std::string::npos || frames[i].file.empty();
    const fs::path own = of_video ? file : frames[i].file;
    const std::string name = of_video ? (file.parent_path() / frames[i].name).string() : own.string();
    const auto known = uses_cache() ? cache_.find(own, name) : std::nullopt;
    found[before + i] = {known ? *known : look(frames[i], name, own), frames[i].grey};
  });
  // A frame without the board is no loss: others have it.
  found.erase(std::remove_if(found.begin() + static_cast<std::ptrdiff_t>(before), found.end(),
                             [](const Looked& one) { return one.board.sighting.corners.empty(); }),
              found.end());
}

// Of views that are nearly the same the sharpest, and of those the ones that differ most.
std::vector<size_t> Search::sharp_and_distinct(const std::vector<Looked>& found) const {
  std::vector<ViewTraits> traits;
  std::vector<size_t> order;
  for (const Looked& one : found) {
    order.push_back(traits.size());
    traits.push_back(view_traits(one.board, board_.grid));
  }
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return found[a].board.sighting.blur_px < found[b].board.sighting.blur_px;
  });
  std::vector<size_t> sharp;
  for (const size_t i : order) {
    const bool is_new = std::all_of(sharp.begin(), sharp.end(),
                                    [&](size_t k) { return (traits[i] - traits[k]).norm() > kDistinct / 2; });
    if (is_new) sharp.push_back(i);
  }
  std::sort(sharp.begin(), sharp.end());
  std::vector<ViewTraits> of_sharp;
  for (const size_t i : sharp) of_sharp.push_back(traits[i]);
  std::vector<size_t> chosen;
  for (const size_t k : choose_distinct(of_sharp, options_.most_frames)) chosen.push_back(sharp[k]);
  return chosen;
}

void Search::sequence(const std::string& source) {
  const auto frames = open_image_source(source);
  // Where its cache is: beside the video, or in the flight's folder.
  const fs::path named = source.substr(source.find(':') + 1);
  const fs::path file = source.starts_with("flight:") ? named / "mav0" / "cam0" / "data.csv" : named;
  const int64_t count = frames->size();
  const auto most = static_cast<int64_t>(options_.most_frames);
  const int64_t window = count > 0 ? std::max<int64_t>(1, count / (kLookedAt * most)) : kWindowOfUnknown;
  std::vector<Looked> found;
  std::vector<Frame> batch;
  Frame frame, best;
  double best_sharpness = -1;
  int64_t seen = 0;
  int unreadable = 0;
  const auto take = [&] {
    if (best_sharpness >= 0) batch.push_back(best);
    best_sharpness = -1;
  };
  while (frames->next(frame)) {
    check_stop();
    ++seen;
    unreadable += !frame.problem.empty();
    const double sharp = frame.problem.empty() ? sharpness(frame.grey) : -1;
    if (sharp > best_sharpness) {
      best = frame;
      best.grey = frame.grey.clone();
      best_sharpness = sharp;
    }
    if (seen % window == 0) take();
    if (batch.size() == kBatch) {
      look_at(batch, file, found);
      batch.clear();
    }
    if (seen % 10 == 0)
      told(count > 0 ? static_cast<double>(seen) / static_cast<double>(count) : 0, "choosing frames");
  }
  take();
  look_at(batch, file, found);
  result_.remarks.insert(result_.remarks.end(), frames->problems().begin(), frames->problems().end());
  if (unreadable > 0)
    result_.remarks.push_back(source + ": " + std::to_string(unreadable) + " frames cannot be read");
  const std::vector<size_t> chosen = sharp_and_distinct(found);
  result_.remarks.push_back(source + ": " + std::to_string(chosen.size()) + " distinct views of " +
                            std::to_string(found.size()) + " with the board, of " + std::to_string(seen) +
                            " frames");
  for (const size_t i : chosen) kept_.push_back(std::move(found[i]));
}

// The lens model is of one size of picture: that of most.
void Search::leave_out_sizes() {
  std::map<std::pair<int, int>, size_t> counts;
  for (const Looked& one : kept_)
    counts[{one.board.width, one.board.height}] += !one.board.sighting.corners.empty();
  const auto most = std::max_element(counts.begin(), counts.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  std::tie(result_.views.width, result_.views.height) = most->first;
  std::erase_if(kept_, [&](const Looked& one) {
    const bool other = one.board.width != result_.views.width || one.board.height != result_.views.height;
    if (other) {
      result_.left_out.push_back(
          {one.board.picture, size_text(one.board.width, one.board.height) + " pixels, most have " +
                                  size_text(result_.views.width, result_.views.height)});
    }
    return other;
  });
}

void Search::leave_out_blurred() {
  std::vector<double> blurs;
  for (const Looked& one : kept_) blurs.push_back(one.board.sighting.blur_px);
  std::nth_element(blurs.begin(), blurs.begin() + static_cast<std::ptrdiff_t>(blurs.size() / 2), blurs.end());
  const double usual = std::max(blurs[blurs.size() / 2], 0.5);
  std::erase_if(kept_, [&](Looked& one) {
    const double blur = one.board.sighting.blur_px;
    if (blur > kBlurPx && blur > kBlurOfOthers * usual) {
      char text[100];
      std::snprintf(text, sizeof text, "blurred: its edges are %.1f px wide, the others' %.1f", blur, usual);
      result_.left_out.push_back({one.board.picture, text});
      return true;
    }
    for (BoardCorner& c : one.board.sighting.corners) c.sigma *= std::max(1.0, blur / usual);
    return false;
  });
}

// What most of a few pictures show in place of the chessboard that was asked for: in one of them something
// beside the board may look like a row more.
std::string Search::what_else(const std::vector<LeftOut>& without) const {
  if (!std::holds_alternative<Chessboard>(board_.pattern)) return {};
  std::map<std::pair<int, int>, std::vector<std::string>> pictures_by_size;
  int tried = 0;
  for (const LeftOut& one : without) {
    Frame frame;
    read_picture(one.picture, Channel::kGrey, frame);
    if (!frame.problem.empty()) continue;
    if (++tried > 5) break;
    const cv::Size size = chessboard_in(frame.grey);
    if (size.width >= 3) pictures_by_size[{size.width, size.height}].push_back(one.picture);
  }
  const auto most =
      std::max_element(pictures_by_size.begin(), pictures_by_size.end(),
                       [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); });
  if (most == pictures_by_size.end()) return {};
  return "; " + most->second.front() + " shows one of " + size_text(most->first.first, most->first.second) +
         " inner corners (a board has one less each way than squares)";
}

void Search::show() const {
  fs::create_directories(options_.show);
  for (size_t i = 0; i < kept_.size(); ++i) {
    const Looked& one = kept_[i];
    Frame frame;
    frame.grey = one.grey;
    if (frame.grey.empty()) read_picture(one.board.picture, Channel::kGrey, frame);
    if (frame.grey.empty()) continue;
    std::string name = fs::path(one.board.picture).filename().string();
    std::replace(name.begin(), name.end(), '#', '_');
    const std::string number = std::to_string(i) + "_";  // two folders may have a picture of the same name
    const fs::path file = options_.show / (number + fs::path(name).stem().string() +
                                           fs::path(name).extension().string() + ".png");
    if (!cv::imwrite(file.string(), draw_corners(frame.grey, one.board.sighting.corners))) {
      throw std::runtime_error(file.string() + ": cannot be written");
    }
  }
}

FoundBoards Search::result() {
  if (uses_cache()) {
    for (const std::string& problem : cache_.save()) result_.remarks.push_back(problem);
  }
  const bool any = std::any_of(kept_.begin(), kept_.end(),
                               [](const Looked& one) { return !one.board.sighting.corners.empty(); });
  if (!any) {
    const std::string pictures =
        kept_.size() == 1 ? "the only picture" : "none of " + std::to_string(kept_.size()) + " pictures";
    std::string reason;
    if (!kept_.empty()) {
      // What cannot be read is named in its problem.
      const auto& [picture, width, height, sighting] = kept_.front().board;
      reason = " (" + (sighting.problem.starts_with(picture) ? "" : picture + ": ") + sighting.problem + ")";
    }
    std::vector<LeftOut> all;
    for (const Looked& one : kept_) all.push_back({one.board.picture, one.board.sighting.problem});
    throw std::runtime_error(board_.text + ": not found, in " + pictures + reason + what_else(all));
  }
  std::erase_if(kept_, [&](const Looked& one) {
    if (!one.board.sighting.corners.empty()) return false;
    result_.left_out.push_back({one.board.picture, one.board.sighting.problem});
    return true;
  });
  if (kept_.size() < result_.left_out.size()) {
    const std::string what = what_else(result_.left_out);
    // A part of another board is found in a few, and calibrates to nonsense.
    if (!what.empty()) throw std::runtime_error(board_.text + ": not in most pictures" + what);
  }
  leave_out_sizes();
  leave_out_blurred();
  if (!options_.show.empty()) show();
  result_.views.grid = board_.grid;
  std::vector<double> sigmas;
  for (Looked& one : kept_) {
    for (const BoardCorner& c : one.board.sighting.corners) sigmas.push_back(c.sigma);
  }
  std::nth_element(sigmas.begin(), sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2),
                   sigmas.end());
  const double usual = sigmas[sigmas.size() / 2];
  for (Looked& one : kept_) {
    for (BoardCorner& c : one.board.sighting.corners) c.sigma /= usual;
    result_.views.views.push_back({one.board.picture, std::move(one.board.sighting.corners)});
  }
  return std::move(result_);
}

}  // namespace

FoundBoards find_boards(const Board& board, const PictureList& pictures, const FindOptions& options,
                        const FindProgress& progress) {
  cv::setNumThreads(1);  // pictures are what runs side by side
  Search search(board, options, progress);
  search.stills(pictures.files);
  for (const std::string& sequence : pictures.sequences) search.sequence(sequence);
  return search.result();
}

}  // namespace perch
