#include "perch/detection/apriltag_detector.h"

#include <stdexcept>

#include "perch/detection/make_detector.h"
#include "perch/simulation/picture.h"
#include "perch/target/tag_family.h"
#include "support/printed_tags.h"
#include "support/rng.h"

namespace perch {
namespace {

// A pinhole camera of 600 px above the plane, its optical axis through (or near) the target's origin.
Eigen::Matrix3d pixel_from_target(double distance, double tilt, double tilt_direction, double yaw) {
  const Eigen::AngleAxisd facing(M_PI, Eigen::Vector3d::UnitX());  // head-on: x right, y up
  const Eigen::AngleAxisd tilting(tilt,
                                  Eigen::Vector3d(std::cos(tilt_direction), std::sin(tilt_direction), 0));
  const Eigen::AngleAxisd turning(yaw, Eigen::Vector3d::UnitZ());
  const Eigen::Matrix3d R = (tilting * facing * turning).toRotationMatrix();
  Eigen::Matrix3d K;
  K << 600, 0, 319.5, 0, 600, 239.5, 0, 0, 1;
  Eigen::Matrix3d H;
  H << R.col(0), R.col(1), Eigen::Vector3d(0, 0, distance);
  return K * H;
}

cv::Mat empty_ground() { return cv::Mat(480, 640, CV_8UC1, cv::Scalar(110)); }

// What a lens and a sensor do to it: blur of 0.7 px, noise of 2 grey levels.
void photograph(cv::Mat& picture, TestRng& rng) {
  cv::GaussianBlur(picture, picture, {}, 0.7);
  cv::Mat noise(picture.size(), CV_16SC1), sum;
  cv::RNG(static_cast<uint64>(rng.index(1 << 30)) + 1).fill(noise, cv::RNG::NORMAL, 0, 2);
  cv::add(picture, noise, sum, cv::noArray(), CV_8U);
  picture = sum;
}

void paint_board(cv::Mat& picture, const AprilTagBoard& board, const Eigen::Matrix3d& pixel_from_target) {
  const TagFamily family = make_tag_family(board.family, 1);
  const int width = family->width_at_border + 2 * (board.border - 1);
  for (const Tag& tag : board.tags) {
    paint_tag(picture, printed_tag(family.get(), tag.id, board.border), width, tag, pixel_from_target);
  }
}

// Every tag found, every corner under its own number and where it was painted.
void expect_all_corners(const Detection& found, const AprilTagBoard& board, const Eigen::Matrix3d& H,
                        double max_error_px) {
  ASSERT_EQ(found.correspondences.size(), 4 * board.tags.size());
  EXPECT_EQ(found.status, DetectionStatus::kFound);
  for (size_t i = 0; i < found.correspondences.size(); ++i) {
    const Correspondence& c = found.correspondences[i];
    ASSERT_EQ(c.feature, static_cast<int>(i));
    const Eigen::Vector2d expected = apply(H, tag_corner(board.tags[i / 4], c.feature % 4));
    EXPECT_LE((c.pixel - expected).norm(), max_error_px) << "corner " << i % 4 << " of tag " << i / 4;
  }
}

// Painted corners scatter by 0.04 px a coordinate; a wrong half-pixel origin would be 0.7 px off, a wrong
// label far more.
constexpr double kMaxErrorPx = 0.3;

struct Board {
  std::string name;
  AprilTagBoard board;
};
void PrintTo(const Board& board, std::ostream* out) { *out << board.name; }

class AprilTagDetectorOn : public testing::TestWithParam<Board> {};

TEST_P(AprilTagDetectorOn, RandomPosesGivesEachCornerItsNumber) {
  const AprilTagBoard& board = GetParam().board;
  AprilTagDetector detector(board);
  TestRng rng;
  for (int i = 0; i < 8; ++i) {
    SCOPED_TRACE(i);
    cv::Mat picture = empty_ground();
    const Eigen::Matrix3d H = pixel_from_target(rng.uniform(2.5, 5), rng.uniform(0, 0.7),
                                                rng.uniform(0, 2 * M_PI), rng.uniform(-M_PI, M_PI));
    paint_board(picture, board, H);
    photograph(picture, rng);
    expect_all_corners(detector.detect(picture, {}), board, H, kMaxErrorPx);
  }
}

// One metre or so across each.
INSTANTIATE_TEST_SUITE_P(
    Boards, AprilTagDetectorOn,
    testing::Values(Board{"OneTag", {"tag36h11", 1, {{7, 0.8, {0, 0}, 0}}}},
                    Board{"LargeAndSmallTurned",
                          {"tag36h11", 1, {{0, 0.6, {-0.2, 0}, 0.5}, {586, 0.3, {0.45, 0.1}, -2}}}},
                    Board{"WideBorder", {"tag36h11", 2, {{3, 0.6, {-0.35, 0}, 0}, {4, 0.6, {0.35, 0}, 0}}}},
                    Board{"WideBorderOf25h9", {"tag25h9", 2, {{1, 0.8, {0, 0}, 0}}}},
                    Board{"BorderThreeWide", {"tag16h5", 3, {{2, 0.8, {0, 0}, 0}}}},
                    Board{"DataOutsideTheBorder", {"tagStandard41h12", 1, {{5, 0.5, {0, 0}, 0}}}}),
    [](const auto& board) { return board.param.name; });

// The labels by hand: head-on and unturned, as printed.
TEST(AprilTagDetector, CornersGoRoundFromTheUpperRightOne) {
  const AprilTagBoard board{"tag36h11", 1, {{7, 0.8, {0, 0}, 0}}};
  cv::Mat picture = empty_ground();
  paint_board(picture, board, pixel_from_target(3, 0, 0, 0));  // a tag of 160 px about the picture's centre
  TestRng rng;
  photograph(picture, rng);
  AprilTagDetector detector(board);
  const Detection& found = detector.detect(picture, {});
  ASSERT_EQ(found.correspondences.size(), 4u);
  const Eigen::Vector2d centre(319.5, 239.5);  // of 640 x 480 pixels, whose first has its centre at (0, 0)
  const Eigen::Vector2d expected[] = {{80, -80}, {-80, -80}, {-80, 80}, {80, 80}};
  for (size_t k = 0; k < 4; ++k) {
    EXPECT_LE((found.correspondences[k].pixel - centre - expected[k]).norm(), kMaxErrorPx) << k;
  }
}

TEST(AprilTagDetector, CornersAreSymmetricAboutTheCentre) {
  // A half-pixel origin left in would move all four corners by (0.5, 0.5) px.
  const AprilTagBoard board{"tag36h11", 1, {{7, 0.8, {0, 0}, 0}}};
  AprilTagDetector detector(board);
  TestRng rng;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  constexpr int kPictures = 10;
  for (int i = 0; i < kPictures; ++i) {
    cv::Mat picture = empty_ground();
    const Eigen::Matrix3d H = pixel_from_target(rng.uniform(2.5, 4), rng.uniform(0, 0.5),
                                                rng.uniform(0, 2 * M_PI), rng.uniform(-M_PI, M_PI));
    paint_board(picture, board, H);
    photograph(picture, rng);
    for (const Correspondence& c : detector.detect(picture, {}).correspondences) {
      sum += c.pixel - apply(H, tag_corner(board.tags[0], c.feature));
    }
  }
  // 40 corners of 0.04 px: 0.006 px a coordinate, were they independent; an edge's two corners are not.
  EXPECT_LE((sum / (4 * kPictures)).norm(), 0.04);
}

// Painted pictures are the best there are: print and lens cost more (see corner_sigma_px), so that here
// sigma_px is an upper bound.
TEST(AprilTagDetector, CornersScatterNoMoreThanTheirSigmaSays) {
  const AprilTagBoard board{"tag36h11", 1, {{7, 0.8, {0, 0}, 0}}};
  for (const bool refine : {true, false}) {
    for (const double decimate : {1., 2.}) {
      AprilTagOptions options;
      options.refine_edges = refine;
      options.quad_decimate = decimate;
      AprilTagDetector detector(board, options);
      TestRng rng;
      double sum = 0;
      int count = 0;
      for (int i = 0; i < 12; ++i) {
        cv::Mat picture = empty_ground();
        const Eigen::Matrix3d H = pixel_from_target(rng.uniform(2.5, 10), rng.uniform(0, 0.7),
                                                    rng.uniform(0, 2 * M_PI), rng.uniform(-M_PI, M_PI));
        paint_board(picture, board, H);
        photograph(picture, rng);
        for (const Correspondence& c : detector.detect(picture, {}).correspondences) {
          sum += ((c.pixel - apply(H, tag_corner(board.tags[0], c.feature))) / c.sigma_px).squaredNorm();
          count += 2;
        }
      }
      EXPECT_GE(count, 80);  // of 96: all but one or two tags are found
      EXPECT_LE(std::sqrt(sum / count), 1.0) << "refine_edges " << refine << ", quad_decimate " << decimate;
    }
  }
}

TEST(AprilTagDetector, AnIdSeenTwiceIsDropped) {
  const AprilTagBoard board{"tag36h11", 1, {{7, 0.4, {-0.5, 0}, 0}, {8, 0.4, {0, 0.4}, 0}}};
  AprilTagBoard scene = board;
  scene.tags.push_back({7, 0.4, {0.5, 0}, 0});
  cv::Mat picture = empty_ground();
  paint_board(picture, scene, pixel_from_target(3, 0, 0, 0.3));
  AprilTagDetector detector(board);
  const Detection& found = detector.detect(picture, {});
  ASSERT_EQ(found.correspondences.size(), 4u);
  EXPECT_EQ(found.correspondences[0].feature, 4);  // tag 8 alone
}

TEST(AprilTagDetector, IdsThatAreNotOnTheBoardAreIgnored) {
  const AprilTagBoard board{"tag36h11", 1, {{7, 0.4, {0, 0}, 0}}};
  const AprilTagBoard scene{"tag36h11", 1, {{8, 0.4, {-0.4, 0}, 0}, {9, 0.4, {0.4, 0}, 0}}};
  cv::Mat picture = empty_ground();
  paint_board(picture, scene, pixel_from_target(3, 0, 0, 0));
  AprilTagDetector detector(board);
  const Detection& found = detector.detect(picture, {});
  EXPECT_EQ(found.status, DetectionStatus::kNoTarget);
  EXPECT_TRUE(found.correspondences.empty());
}

TEST(AprilTagDetector, ATagWithAnotherBorderIsNotTaken) {
  const AprilTagBoard wide{"tag36h11", 2, {{7, 0.8, {0, 0}, 0}}}, narrow{"tag36h11", 1, wide.tags};
  cv::Mat picture = empty_ground();
  paint_board(picture, wide, pixel_from_target(3, 0, 0, 0));
  EXPECT_EQ(AprilTagDetector(narrow).detect(picture, {}).status, DetectionStatus::kNoTarget);
  EXPECT_EQ(AprilTagDetector(wide).detect(picture, {}).status, DetectionStatus::kFound);
}

TEST(AprilTagDetector, WrongBitsCountOnlyAsFarAsAllowed) {
  const AprilTagBoard board{"tag36h11", 1, {{7, 0.8, {0, 0}, 0}}};
  const TagFamily family = make_tag_family(board.family, 1);
  cv::Mat printed = printed_tag(family.get(), 7, 1);
  printed.at<uchar>(4, 4) = static_cast<uchar>(255 - printed.at<uchar>(4, 4));
  cv::Mat picture = empty_ground();
  paint_tag(picture, printed, family->width_at_border, board.tags[0], pixel_from_target(3, 0, 0, 0));
  EXPECT_EQ(AprilTagDetector(board).detect(picture, {}).status, DetectionStatus::kNoTarget);
  AprilTagOptions lenient;
  lenient.max_hamming = 1;
  EXPECT_EQ(AprilTagDetector(board, lenient).detect(picture, {}).status, DetectionStatus::kFound);
}

TEST(AprilTagDetector, ATagInTheNoiseIsNotTrusted) {
  const AprilTagBoard board{"tag36h11", 1, {{7, 0.8, {0, 0}, 0}}};
  const TagFamily family = make_tag_family(board.family, 1);
  cv::Mat picture = empty_ground();
  paint_tag(picture, printed_tag(family.get(), 7, 1), family->width_at_border, board.tags[0],
            pixel_from_target(3, 0, 0, 0), 100, 108);  // 4 levels from the middle, 8 sharpened
  EXPECT_EQ(AprilTagDetector(board).detect(picture, {}).status, DetectionStatus::kNoTarget);
  AprilTagOptions lenient;
  lenient.min_decision_margin = 0;
  EXPECT_EQ(AprilTagDetector(board, lenient).detect(picture, {}).status, DetectionStatus::kFound);
}

TEST(AprilTagDetector, SurvivesPicturesThatHoldNothing) {
  const AprilTagBoard board{"tag36h11", 1, {{7, 0.8, {0, 0}, 0}}};
  for (const double decimate : {1., 1.5, 2., 4.}) {
    for (const double sigma : {0., 1.}) {
      AprilTagOptions options;
      options.quad_decimate = decimate;
      options.quad_sigma = sigma;
      options.threads = 1 + static_cast<int>(sigma);
      AprilTagDetector detector(board, options);
      TestRng rng;
      for (const cv::Size size :
           {cv::Size(0, 0), {1, 1}, {1, 480}, {640, 1}, {3, 3}, {17, 9}, {80, 60}, {2000, 5}, {40000, 2}}) {
        for (const bool noise : {false, true}) {
          cv::Mat picture(size, CV_8UC1, cv::Scalar(0));
          if (noise) {
            for (uchar& level : cv::Mat_<uchar>(picture)) level = rng.index(2) ? 255 : 0;
          }
          const Detection& found = detector.detect(picture, {});
          EXPECT_EQ(found.status, DetectionStatus::kNoTarget);
          ASSERT_EQ(found.stages.size(), 1u);
          EXPECT_EQ(found.stages[0].stage, "apriltag");
        }
      }
    }
  }
}

TEST(AprilTagDetector, SmallPicturesAndPartsOfPicturesAreAsGoodAsWholeOnes) {
  const AprilTagBoard board{"tag36h11", 1, {{7, 0.4, {0, 0}, 0}}};
  cv::Mat picture = empty_ground();
  const Eigen::Matrix3d H = pixel_from_target(3, 0.2, 1, 0.3);  // 80 px
  paint_board(picture, board, H);
  for (const double sigma : {0., 0.8}) {
    AprilTagOptions options;
    options.quad_decimate = sigma > 0 ? 1 : 2;
    options.quad_sigma = sigma;
    AprilTagDetector detector(board, options);
    for (const cv::Rect part : {cv::Rect(0, 0, 640, 480), {101, 51, 437, 379}, {250, 170, 140, 140}}) {
      const cv::Mat before = picture.clone();
      const std::vector<Correspondence> found = detector.detect(picture(part), {}).correspondences;
      ASSERT_EQ(found.size(), 4u) << part;
      for (const Correspondence& c : found) {
        const Eigen::Vector2d pixel = c.pixel + Eigen::Vector2d(part.x, part.y);
        EXPECT_LE((pixel - apply(H, tag_corner(board.tags[0], c.feature))).norm(), kMaxErrorPx) << part;
      }
      EXPECT_EQ(cv::norm(picture, before, cv::NORM_INF), 0) << "the picture was written to";
    }
  }
}

TEST(AprilTagDetector, TheSamePictureGivesTheSameResult) {
  const AprilTagBoard board{"tag36h11", 1, {{7, 0.8, {0, 0}, 0}}};
  cv::Mat picture = empty_ground();
  paint_board(picture, board, pixel_from_target(3, 0.3, 1, 0.3));
  AprilTagDetector detector(board);
  const std::vector<Correspondence> first = detector.detect(picture, {}).correspondences;
  detector.detect(empty_ground(), {});
  const std::vector<Correspondence> again = detector.detect(picture, {}).correspondences;
  ASSERT_EQ(first.size(), 4u);
  ASSERT_EQ(again.size(), 4u);
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(first[i].pixel, again[i].pixel);
}

TEST(AprilTagDetector, RefusesBoardsThatCannotBe) {
  const std::vector<Tag> tags{{7, 0.8, {0, 0}, 0}};
  EXPECT_THROW(AprilTagDetector({"tag37h11", 1, tags}), std::invalid_argument);
  EXPECT_THROW(AprilTagDetector({"tag36h11", 0, tags}), std::invalid_argument);
  EXPECT_THROW(AprilTagDetector({"tagStandard41h12", 2, tags}), std::invalid_argument);
  EXPECT_THROW(AprilTagDetector({"tag36h11", 1, {{587, 0.8, {0, 0}, 0}}}), std::invalid_argument);
  EXPECT_THROW(AprilTagDetector({"tag36h11", 1, {{-1, 0.8, {0, 0}, 0}}}), std::invalid_argument);
  EXPECT_THROW(AprilTagDetector({"tag36h11", 1, {tags[0], tags[0]}}), std::invalid_argument);
  AprilTagOptions options;
  options.quad_decimate = 1.7;
  EXPECT_THROW(AprilTagDetector({"tag36h11", 1, tags}, options), std::invalid_argument);
}

// The whole way: target file, features, renderer, detector, which must agree about every corner.
TEST(AprilTagDetector, FindsTheFeaturesOfARenderedTargetFile) {
  for (const std::string border : {"1", "2"}) {
    const LandingTarget target =
        read_target(Section::parse("{type: apriltag, family: tag36h11, border: " + border +
                                       ", tags: [{id: 3, size: 0.6, center: [-0.3, 0.1], yaw: 0.4}, {id: 11, "
                                       "size: 0.3, center: [0.4, -0.1]}]}",
                                   "board.yaml"));
    const auto detector = make_detector(target, CameraModel::pinhole(500, 500, 320, 240, 641, 481), {});
    const CameraModel camera = CameraModel::pinhole(600, 610, 330, 230, 640, 480);
    const Rigid3 camera_from_target{Eigen::AngleAxisd(0.3, Eigen::Vector3d(0.6, -0.8, 0)) *
                                        Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()) *
                                        Eigen::AngleAxisd(1, Eigen::Vector3d::UnitZ()),
                                    Eigen::Vector3d(0.1, -0.1, 2.5)};
    const Detection& found = detector->detect(render(target, camera, camera_from_target), {});
    ASSERT_EQ(found.correspondences.size(), target.features.size()) << "border " << border;
    for (const Correspondence& c : found.correspondences) {
      const Feature& feature = target.features[static_cast<size_t>(c.feature)];
      const Eigen::Vector3d p_target(feature.point.x(), feature.point.y(), 0);
      const auto expected = camera.pixel_from_camera(camera_from_target * p_target);
      EXPECT_LE((c.pixel - *expected).norm(), kMaxErrorPx) << feature.name << ", border " << border;
    }
  }
}

AprilTagOptions options_from(const std::string& text) {
  Section run = Section::parse(text, "run.yaml");
  return read_apriltag_options(run.section("apriltag"));
}

TEST(AprilTagOptions, AreReadFromTheirSection) {
  const AprilTagOptions options = options_from(
      "apriltag: {quad_decimate: 1.5, quad_sigma: 0.8, refine_edges: false, threads: 2, "
      "max_hamming: 1, min_decision_margin: 30}");
  EXPECT_EQ(options.quad_decimate, 1.5);
  EXPECT_EQ(options.quad_sigma, 0.8);
  EXPECT_FALSE(options.refine_edges);
  EXPECT_EQ(options.threads, 2);
  EXPECT_EQ(options.max_hamming, 1);
  EXPECT_EQ(options.min_decision_margin, 30);
}

TEST(AprilTagOptions, KeepTheirDefaultsWhereTheFileIsSilent) {
  EXPECT_EQ(options_from("apriltag: {}").quad_decimate, AprilTagOptions{}.quad_decimate);
  EXPECT_EQ(options_from("{}").min_decision_margin, AprilTagOptions{}.min_decision_margin);
}

TEST(AprilTagOptions, RefuseWhatLibapriltagCannotDo) {
  EXPECT_THROW(options_from("apriltag: {quad_decimate: 1.7}}"), ConfigError);
  EXPECT_THROW(options_from("apriltag: {max_hamming: 3}"), ConfigError);
  EXPECT_THROW(options_from("apriltag: {threads: 0}"), ConfigError);
  EXPECT_THROW(options_from("apriltag: {decimate: 2}"), ConfigError);
}

}  // namespace
}  // namespace perch
