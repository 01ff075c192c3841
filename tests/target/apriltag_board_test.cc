#include <sstream>

#include "perch/target/landing_target.h"
#include "perch/target/tag_family.h"
#include "support/config_error.h"
#include "support/near_pose.h"
#include "support/rng.h"
#include "target/raster.h"

namespace perch {
namespace {

LandingTarget read(const std::string& yaml) { return read_target(Section::parse(yaml, "t.yaml")); }

std::string error_of(const std::string& yaml) {
  return config_error([&] { read(yaml); });
}

struct Found {
  int id = 0;
  Eigen::Vector2d corners[4];  // in libapriltag's order, px
};

// libapriltag's own opinion of a picture.
std::vector<Found> detect(const Raster& raster, const std::string& family_name, int border) {
  const TagFamily family = make_tag_family(family_name, border);
  apriltag_detector_t* detector = apriltag_detector_create();
  detector->quad_decimate = 1;
  apriltag_detector_add_family_bits(detector, family.get(), 0);  // a bit in the wrong place is a failure
  std::vector<uint8_t> grey = raster.grey;
  image_u8_t image{
      .width = raster.width, .height = raster.height, .stride = raster.width, .buf = grey.data()};
  zarray_t* detections = apriltag_detector_detect(detector, &image);
  std::vector<Found> found;
  for (int i = 0; i < zarray_size(detections); ++i) {
    apriltag_detection_t* detection = nullptr;
    zarray_get(detections, i, &detection);
    Found tag{detection->id, {}};
    for (size_t k = 0; k < 4; ++k) tag.corners[k] = {detection->p[k][0], detection->p[k][1]};
    found.push_back(tag);
  }
  apriltag_detections_destroy(detections);
  apriltag_detector_destroy(detector);
  return found;
}

// Every tag found once, and corner k of tags[i] where feature 4 i + k is, by the map of landing_target.h.
void expect_detected(const LandingTarget& target, double per_metre) {
  const auto& board = std::get<AprilTagBoard>(target.layout);
  const Raster raster = raster_of(target, per_metre, 0.02);
  const std::vector<Found> found = detect(raster, board.family, board.border);
  EXPECT_EQ(found.size(), board.tags.size());
  for (size_t i = 0; i < board.tags.size(); ++i) {
    const auto tag =
        std::find_if(found.begin(), found.end(), [&](const Found& f) { return f.id == board.tags[i].id; });
    ASSERT_NE(tag, found.end()) << board.family << " border " << board.border << " id " << board.tags[i].id;
    for (size_t k = 0; k < 4; ++k) {
      // What libapriltag's line fits leave on a clean picture of tags this large; another corner or the next
      // module would be 10 px off at least.
      EXPECT_THAT(tag->corners[(k + 2) % 4],
                  IsNearMatrix(raster.pixel(target.features[4 * i + k].point), 0.5))
          << board.family << " border " << board.border << ' ' << target.features[4 * i + k].name;
    }
  }
}

TEST(AprilTagBoard, LibapriltagFindsEveryFamilyWhereItsFeaturesAre) {
  for (const std::string& family : tag_family_names()) {
    expect_detected(
        read("type: apriltag\nfamily: " + family +
             "\ntags:\n  - {id: 3, size: 0.1}\n  - {id: 7, size: 0.1, center: [0.3, 0.05], yaw: 0.4}\n"
             "  - {id: 12, size: 0.1, center: [0, 0.3], yaw: -1.5}\n"
             "  - {id: 29, size: 0.08, center: [0.3, 0.35], yaw: 3}\n"),
        1500);
  }
}

TEST(AprilTagBoard, WideBordersAreFoundAtTheirOuterEdge) {
  for (const char* family : {"tag36h11", "tag25h9", "tag16h5"}) {
    for (const char* border : {"2", "3"}) {
      expect_detected(
          read(std::string("type: apriltag\nfamily: ") + family + "\nborder: " + border +
               "\ntags:\n  - {id: 3, size: 0.12}\n  - {id: 7, size: 0.12, center: [0.3, 0], yaw: 0.4}\n"),
          1500);
    }
  }
}

TEST(AprilTagBoard, ASmallTagIsFoundInTheFreeCentreOfALargeOne) {
  // The centre of tagCustom48h12 is 2 of its 6 modules: 0.1 m of 0.3; a tag of 0.058 m with its data outside
  // of the border (10 modules of 0.0097 m) just fits.
  expect_detected(
      read("type: apriltag\nfamily: tagCustom48h12\ntags: [{id: 1, size: 0.058}, {id: 0, size: 0.3}]\n"),
      2000);
}

TEST(AprilTagBoard, ExampleBoardsAreFound) {
  const std::filesystem::path targets = std::filesystem::path(PERCH_SOURCE_DIR) / "configs" / "targets";
  expect_detected(read_target(targets / "two_tags.yaml"), 800);
  const LandingTarget grid = read_target(targets / "aprilgrid_6x6.yaml");
  ASSERT_EQ(grid.features.size(), 144u);
  // Tag 0's lower left corner is the origin; tag 35, at the upper right, ends after 6 tags and 5 gaps.
  EXPECT_THAT(grid.features[2].point, IsNearMatrix(Eigen::Vector2d(0, 0), 1e-12));
  EXPECT_THAT(grid.features[4 * 35].point,
              IsNearMatrix(Eigen::Vector2d::Constant(6 * 0.088 + 5 * 0.0264), 1e-12));
  EXPECT_EQ(grid.features[4 * 35].name, "tag35.0");
  expect_detected(grid, 1200);
}

TEST(AprilTagBoard, QuietZonesDoNotPaintOverNeighbours) {
  // Half a module of tag 1 apart: its quiet zone would cover tag 0's edge by half a module.
  const LandingTarget target = read(
      "type: apriltag\nfamily: tag36h11\ntags: [{id: 0, size: 0.08}, {id: 1, size: 0.08, center: [0.085, "
      "0]}]\n");
  const Raster raster = raster_of(target, 4000, 0.01);
  EXPECT_EQ(raster.at({0.0395, 0}), 0);
  EXPECT_EQ(raster.at({0.0425, 0}), 255);
  EXPECT_EQ(raster.at({0.0455, 0}), 0);
}

TEST(AprilTagBoard, SizeIsTheLongerSideOfWhatIsPrinted) {
  // 10 modules each, the quiet zones counted, with 8 of them 0.08 m.
  const LandingTarget target = read(
      "type: apriltag\nfamily: tag36h11\ntags: [{id: 0, size: 0.08}, {id: 1, size: 0.08, center: [0.2, "
      "0]}]\n");
  EXPECT_NEAR(target.size, 0.3, 8 * kEpsilon);
}

TEST(AprilTagBoard, YawTurnsATagCounterclockwiseAndItsFeaturesWithIt) {
  const LandingTarget target = read(
      "type: apriltag\nfamily: tag36h11\ntags: [{id: 0, size: 2, center: [5, 0], yaw: "
      "1.5707963267948966}]\n");
  const Eigen::Vector2d turned[4] = {{4, 1}, {4, -1}, {6, -1}, {6, 1}};  // its upper right is now upper left
  for (size_t k = 0; k < 4; ++k) EXPECT_THAT(target.features[k].point, IsNearMatrix(turned[k], 8 * kEpsilon));
}

// Squares with one axis-parallel: whether they meet is asked of a fine grid of points instead of separating
// axes.
TEST(AprilTagBoard, RandomPairsOfTagsAreTakenExactlyWhenTheyAreApart) {
  int taken = 0, asked = 0;
  for (unsigned run = 0; run < 300; ++run) {
    TestRng rng(run);
    const double x = rng.uniform(-1.5, 1.5), y = rng.uniform(-1.5, 1.5), yaw = rng.uniform(-6, 6);
    const double c = std::cos(yaw), s = std::sin(yaw);
    double nearest =
        1e9;  // of the second tag's points, the largest coordinate in the first: under 0.5 is inside
    constexpr int kPoints = 200;
    for (int i = 0; i <= kPoints; ++i) {
      for (int j = 0; j <= kPoints; ++j) {
        const double u = 0.8 * (static_cast<double>(i) / kPoints - 0.5),
                     v = 0.8 * (static_cast<double>(j) / kPoints - 0.5);
        nearest = std::min(nearest, std::max(std::abs(x + c * u - s * v), std::abs(y + s * u + c * v)));
      }
    }
    // Within a grid step of touching the grid cannot say.
    if (std::abs(nearest - 0.5) < 0.8 / kPoints) continue;
    std::ostringstream yaml;
    yaml << "type: apriltag\nfamily: tag36h11\ntags: [{id: 0, size: 1}, {id: 1, size: 0.8, center: [" << x
         << ", " << y << "], yaw: " << yaw << "}]\n";
    EXPECT_EQ(error_of(yaml.str()) == "no error", nearest > 0.5) << yaml.str();
    ++asked;
    taken += nearest > 0.5 ? 1 : 0;
  }
  EXPECT_GT(taken, asked / 4);
  EXPECT_LT(taken, 3 * asked / 4);
}

struct Slip {
  const char* yaml;
  const char* message;
};

void PrintTo(const Slip& slip, std::ostream* stream) { *stream << slip.yaml; }

class BadBoard : public testing::TestWithParam<Slip> {};

TEST_P(BadBoard, IsRefusedWithItsPlaceAndCause) {
  EXPECT_EQ(error_of(std::string("type: apriltag\n") + GetParam().yaml), GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    Slips, BadBoard,
    testing::Values(
        Slip{"family: tag36h12\ntags: [{id: 0, size: 1}]",
             "t.yaml:2: family: expected one of tag36h11, tag25h9, tag16h5, tag36h10, tagStandard41h12, "
             "tagStandard52h13, tagCircle21h7, tagCircle49h12, tagCustom48h12, found \"tag36h12\""},
        Slip{"family: tag36h11\ntags: [{id: 587, size: 1}]",
             "t.yaml:3: tags[0].id: expected a whole number between 0 and 586, found \"587\""},
        Slip{"family: tag16h5\ntags: [{id: -1, size: 1}]",
             "t.yaml:3: tags[0].id: expected a whole number between 0 and 29, found \"-1\""},
        Slip{"family: tag36h11\ntags: [{id: 0}]",
             "t.yaml:3: tags[0].size: expected the side of the border's outer edge in m, found nothing"},
        Slip{"family: tag36h11\ntags: [{id: 0, size: nan}]",
             "t.yaml:3: tags[0].size: expected a number between 0.001 and 100, found \"nan\""},
        Slip{"family: tag36h11\ntags:\n  - {id: 0, size: 1}\n  - {id: 0, size: 1, center: [2, 0]}",
             "t.yaml:5: tags[1].id: expected each id once, found 0 a second time"},
        Slip{"family: tag36h11\ntags:\n  - {id: 0, size: 1}\n  - {id: 1, size: 1, center: [0.9, 0]}",
             "t.yaml:5: tags[1].center: expected a tag clear of tag 0, found both overlap or touch"},
        Slip{"family: tag36h11\ntags:\n  - {id: 0, size: 1}\n  - {id: 1, size: 1, center: [1, 1]}",
             "t.yaml:5: tags[1].center: expected a tag clear of tag 0, found both overlap or touch"},
        Slip{"family: tag36h11\ntags:\n  - {id: 0, size: 1}\n  - {id: 1, size: 0.1}",
             "t.yaml:5: tags[1].center: expected a tag clear of tag 0, found both overlap or touch"},
        Slip{"family: tagStandard41h12\nborder: 2\ntags: [{id: 0, size: 1}]",
             "t.yaml:3: border: expected 1 with tagStandard41h12, which has a white border, found \"2\""},
        Slip{"family: tag36h11\ntags: []",
             "t.yaml:3: tags: expected a list of at least one {id, size, center, yaw}, found a list of 0"},
        Slip{"family: tag36h11",
             "t.yaml:1: tags: expected a list of at least one {id, size, center, yaw}, found nothing"},
        Slip{"family: tag36h11\nsize: 1\ntags: [{id: 0, size: 1}]",
             "t.yaml:3: size: expected one of border, family, name, tags, type, found an unknown key"},
        Slip{"family: tag36h11\ntags: [{id: 0, size: 1, angle: 3}]",
             "t.yaml:3: tags[0].angle: expected one of center, id, size, yaw, found an unknown key"},
        Slip{"family: tag36h11\ntags: [{id: 0, size: 1, yaw: 90}]",
             "t.yaml:3: tags[0].yaw: expected an angle in rad, a turn (6.28) at most, found \"90\""}));

}  // namespace
}  // namespace perch
