#include "calib/camera/find_boards.h"

#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/camera/corner_cache.h"
#include "calib/camera/frame_choice.h"
#include "perch/simulation/picture.h"
#include "support/drawing.h"
#include "support/printed_boards.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

using testing::HasSubstr;

const Board& board() {
  static const Board made = parse_board("7x5", 0.03);
  return made;
}

// Small pictures, since each is looked at many times here.
cv::Mat picture(int k, double scale = 1) {
  static const CameraModel camera = CameraModel::pinhole(300, 300, 159.5, 119.5, 320, 240);
  static const Renderer renderer(camera, printed_chessboard(board().grid));
  const double a = 1.3 * k;
  const Rigid3 pose = looking_pose(0.34 + 0.03 * (k % 3), 0.1 * (1 + k % 4), a, 0.1,
                                   {0.03 * std::cos(a), 0.03 * std::sin(a)});
  cv::Mat grey = Sensor().picture(renderer.radiance(pose), static_cast<uint64_t>(k));
  if (scale != 1) cv::resize(grey, grey, {}, scale, scale);
  return grey;
}

class FindBoards : public testing::Test {
 protected:
  std::string put(const std::string& name, const cv::Mat& grey) {
    const auto file = folder_ / name;
    std::filesystem::create_directories(file.parent_path());
    cv::imwrite(file.string(), grey);
    return file.string();
  }
  FoundBoards find(const FindOptions& options = {}) {
    return find_boards(board(), list_pictures({folder_.path().string()}), options);
  }
  std::string error() {
    try {
      find();
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "no error";
  }
  static std::string reason(const FoundBoards& found, const std::string& name) {
    for (const LeftOut& one : found.left_out) {
      if (one.picture.ends_with(name)) return one.reason;
    }
    return "not left out";
  }

  TempFolder folder_;
};

TEST_F(FindBoards, LeavesOutWhatIsOfNoUseAndSaysWhy) {
  for (int k = 0; k < 4; ++k) put("good" + std::to_string(k) + ".png", picture(k));
  put("large.png", picture(1, 1.5));
  put("empty.png", cv::Mat(240, 320, CV_8UC1, cv::Scalar(120)));
  folder_.write("torn.png", read_file(folder_ / "good1.png").substr(0, 4000));
  cv::Mat smeared;
  cv::blur(picture(2), smeared, {7, 1});
  put("smeared.png", smeared);
  const FoundBoards found = find();
  EXPECT_EQ(found.views.views.size(), 4U);
  EXPECT_EQ(found.views.width, 320);
  EXPECT_EQ(found.views.height, 240);
  EXPECT_EQ(reason(found, "large.png"), "480x360 pixels, most have 320x240");
  EXPECT_EQ(reason(found, "empty.png"), "no 7x5 chessboard");
  EXPECT_THAT(reason(found, "torn.png"), HasSubstr("torn.png"));
  EXPECT_THAT(reason(found, "smeared.png"),
              testing::AnyOf(HasSubstr("blurred: "), HasSubstr("no 7x5 chessboard")));
  for (const BoardView& view : found.views.views) EXPECT_EQ(view.corners.size(), 35U);
}

TEST_F(FindBoards, TellsTheBoardThatIsThere) {
  put("one.png", picture(0));
  const Board asked = parse_board("8x6", 0.03);
  try {
    find_boards(asked, list_pictures({folder_.path().string()}), {});
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("chessboard 8x6"));
    EXPECT_THAT(e.what(), HasSubstr("shows one of 7x5 inner corners"));
  }
}

TEST_F(FindBoards, SaysThatThereIsNoBoard) {
  put("empty.png", cv::Mat(240, 320, CV_8UC1, cv::Scalar(120)));
  EXPECT_THAT(error(), HasSubstr("not found, in the only picture"));
}

TEST_F(FindBoards, RemembersCornersUntilThePictureChanges) {
  for (int k = 0; k < 3; ++k) put("p" + std::to_string(k) + ".png", picture(k));
  const FoundBoards first = find();
  const auto cache = folder_ / CornerCache::kFileName;
  ASSERT_TRUE(std::filesystem::exists(cache));
  // What is in the cache is what is believed: a corner moved there comes out moved.
  std::string text = read_file(cache);
  const size_t at = text.find("[0,0,");
  ASSERT_NE(at, std::string::npos);
  text.replace(at, 5, "[0,0,1000");  // p0's first corner, now beyond 1000 px
  folder_.write(CornerCache::kFileName, text);
  EXPECT_GT(find().views.views[0].corners[0].pixel.x(), 1000);
  // Another picture under the same name.
  put("p0.png", picture(7));
  EXPECT_LT(find().views.views[0].corners[0].pixel.x(), 320);
  // And the same again without looking at the cache.
  FindOptions options;
  options.cache = false;
  EXPECT_EQ(find(options).views.views[1].corners[3].pixel, first.views.views[1].corners[3].pixel);
}

TEST_F(FindBoards, IgnoresABrokenCacheAndSaysSo) {
  put("p0.png", picture(0));
  for (const char* broken : {"", "{", "[1, 2]", "{\"version\": 1, \"boards\": 3}"}) {
    folder_.write(CornerCache::kFileName, broken);
    const FoundBoards found = find();
    EXPECT_EQ(found.views.views.size(), 1U);
    ASSERT_EQ(found.remarks.size(), 1U) << broken;
    EXPECT_THAT(found.remarks[0], HasSubstr("no cache of corners"));
    EXPECT_TRUE(find().remarks.empty());  // it was written anew
  }
  // An entry that someone edited is found anew, without a word.
  std::string text = read_file(folder_ / CornerCache::kFileName);
  text.replace(text.find("\"corners\":["), 11, "\"corners\":[7,");
  folder_.write(CornerCache::kFileName, text);
  EXPECT_EQ(find().views.views[0].corners.size(), 35U);
}

TEST_F(FindBoards, ShowsTheCornersInPictures) {
  put("p0.png", picture(0));
  FindOptions options;
  options.show = folder_ / "shown";
  find(options);
  const cv::Mat shown = cv::imread((options.show / "0_p0.png.png").string());
  EXPECT_EQ(shown.size(), cv::Size(320, 240));
}

// A camera that stands still says the same again and again; one that moves blurs.
TEST_F(FindBoards, ChoosesSharpAndDistinctFramesOfAFlight) {
  const auto cam0 = std::filesystem::path("mav0/cam0");
  std::string rows = "#timestamp [ns],filename\n";
  auto add = [&, n = 0](const cv::Mat& grey) mutable {
    const std::string name = std::to_string(n) + ".png";
    put(cam0 / "data" / name, grey);
    rows += std::to_string(1'000'000'000LL + 33'000'000LL * n++) + "," + name + "\n";
  };
  for (int k = 0; k < 4; ++k) {
    cv::Mat smeared;
    cv::blur(picture(k), smeared, {4, 4});
    for (int repeated = 0; repeated < 3; ++repeated) add(repeated == 1 ? picture(k) : smeared);
  }
  folder_.write(cam0 / "data.csv", rows);
  FindOptions options;
  options.most_frames = 1;  // 12 frames, of which every third is looked at
  EXPECT_EQ(find(options).views.views.size(), 1U);
  options.most_frames = 10;
  options.cache = false;
  const FoundBoards found = find(options);
  EXPECT_EQ(found.views.views.size(), 4U);
  // The second of each three is the sharp one.
  for (size_t k = 0; k < found.views.views.size(); ++k) {
    EXPECT_THAT(found.views.views[k].picture, testing::EndsWith(std::to_string(3 * k + 1) + ".png"));
  }
}

TEST(ChooseDistinct, TakesTheFarthestAndNoneTwice) {
  std::vector<ViewTraits> views;
  for (const double x : {0.1, 0.1, 0.9, 0.11, 0.5, 0.5}) views.push_back(x * ViewTraits::Unit(0));
  EXPECT_EQ(choose_distinct(views, 10), (std::vector<size_t>{0, 2, 4}));
  EXPECT_EQ(choose_distinct(views, 2), (std::vector<size_t>{0, 2}));
  EXPECT_TRUE(choose_distinct({}, 3).empty());
}

TEST(ListPictures, TakesFilesGlobsFoldersFlightsAndVideosEachOnce) {
  const TempFolder folder;
  const std::string a = folder.write("d/10.png", "x"), b = folder.write("d/2.png", "x");
  folder.write("d/notes.txt", "x");
  folder.write("v.MKV", "x");
  folder.write("f/mav0/cam0/data.csv", "x");
  const std::string root = folder.path().string();
  const PictureList list = list_pictures({root + "/d", root + "/d/*.png", a, root + "/v.MKV", root + "/f"});
  EXPECT_EQ(list.files, (std::vector<std::filesystem::path>{b, a}));
  EXPECT_EQ(list.sequences, (std::vector<std::string>{"video:" + root + "/v.MKV", "flight:" + root + "/f"}));
  for (const std::string& wrong : {root + "/none.png", root + "/none*.png", root + "/f/mav0"}) {
    EXPECT_THROW(list_pictures({wrong}), std::runtime_error) << wrong;
  }
}

TEST(Board, RefusesWhatIsNoBoard) {
  for (const char* text : {"", "9", "9x", "9x6x", "1x6", "charuco", "charuco:9", "9x600"}) {
    EXPECT_THROW(parse_board(text, 0.03), std::invalid_argument) << text;
  }
  EXPECT_THROW(parse_board("9x6", 0), std::invalid_argument);
  EXPECT_THROW(parse_board("charuco:9x6", 0.03, 0.03, "4X4_50"), std::invalid_argument);
  std::vector<GridPlace> places;
  // Nothing that two lengths of pi and 1 are multiples of.
  EXPECT_THROW(grid_of_points({{0, 0}, {M_PI, 0}, {1, 0}, {0, 1}}, places), std::invalid_argument);
}

}  // namespace
}  // namespace perch
