#include "perch/target/landing_target.h"

#include <sstream>

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

const std::filesystem::path kTargets = std::filesystem::path(PERCH_SOURCE_DIR) / "configs" / "targets";

// The paper's layout, line by line, with one line replaced: what a slip in a good file would be.
std::string sharp_with(const std::string& line, const std::string& instead) {
  const std::string sharp =
      "size: 1\nmodules: 20\nborder: 3\nsquares:\n"
      "  A: [10, 10, 5]\n  B: [5, 13, 2]\n  C: [5, 9, 2]\n  D: [5, 5, 2]\n  E: [9, 5, 2]\n  F: [13, 5, 2]\n"
      "nested:\n  in: A\n  hole: 3.2\n  inner: 2.6\n";
  std::string text = sharp;
  const size_t at = text.find(line);
  EXPECT_NE(at, std::string::npos) << line;
  return text.replace(at, line.size(), instead);
}

TEST(LandingTarget, SharpHasTheFeaturesOfThePapersFigure) {
  const LandingTarget target = read_target(kTargets / "sharp.yaml");
  EXPECT_EQ(target.name, "sharp");
  EXPECT_EQ(target.size, 1.0);
  ASSERT_EQ(target.features.size(), 24u);
  EXPECT_EQ(target.features[0].name, "A0");
  EXPECT_EQ(target.features[23].name, "F3");
  // A covers modules 10 to 15 of 20, 0.05 m each, from -0.5 m: its lower left corner is the origin. Rounding
  // alone.
  const Eigen::Vector2d a[4] = {{0.25, 0.25}, {0, 0.25}, {0, 0}, {0.25, 0}};
  for (size_t k = 0; k < 4; ++k) EXPECT_THAT(target.features[k].point, IsNearMatrix(a[k], 4 * kEpsilon));
  EXPECT_THAT(target.features[13].point, IsNearMatrix(Eigen::Vector2d(-0.25, -0.15), 4 * kEpsilon));  // D1
  const auto& layout = std::get<SquaresLayout>(target.layout);
  EXPECT_NEAR(layout.border, 0.15, 4 * kEpsilon);
  EXPECT_TRUE(layout.outer_edge_printed);
  EXPECT_FALSE(layout.nested.has_value());
}

TEST(LandingTarget, NestedRepeatsTheOuterTargetInTheMiddleOfItsHole) {
  const LandingTarget target = read_target(kTargets / "nested.yaml");
  ASSERT_EQ(target.features.size(), 48u);
  EXPECT_EQ(target.features[24].name, "a0");
  EXPECT_EQ(target.features[47].name, "f3");
  const auto& layout = std::get<SquaresLayout>(target.layout);
  ASSERT_TRUE(layout.nested.has_value());
  EXPECT_THAT(layout.nested->centre, IsNearMatrix(Eigen::Vector2d(0.125, 0.125), 4 * kEpsilon));
  EXPECT_NEAR(layout.nested->hole, 0.16, 4 * kEpsilon);
  EXPECT_NEAR(layout.nested->size, 0.13, 4 * kEpsilon);
  for (size_t i = 0; i < 24; ++i) {
    const Eigen::Vector2d expected = layout.nested->centre + 0.13 * target.features[i].point;
    EXPECT_THAT(target.features[24 + i].point, IsNearMatrix(expected, 4 * kEpsilon));
  }
}

TEST(LandingTarget, SquaresComeInAlphabeticalOrderWhateverTheFiles) {
  const LandingTarget target =
      read("size: 2\nmodules: 10\nborder: 1\nsquares: {C: [2, 2, 1], A: [4, 4, 1], B: [6, 6, 1]}\n");
  std::string names;
  for (const Feature& feature : target.features) names += feature.name;
  EXPECT_EQ(names, "A0A1A2A3B0B1B2B3C0C1C2C3");
}

TEST(LandingTarget, WithoutANameIsCalledAsItsFile) {
  EXPECT_EQ(read("size: 1\nmodules: 9\nborder: 1\nsquares: {A: [4, 4, 1]}\n").name, "t");
}

TEST(LandingTarget, ACutOuterEdgeIsRemembered) {
  const auto target = read("outer_edge: cut\nsize: 1\nmodules: 9\nborder: 1\nsquares: {A: [4, 4, 1]}\n");
  EXPECT_FALSE(std::get<SquaresLayout>(target.layout).outer_edge_printed);
}

TEST(LandingTarget, PatchesPaintEachPlaceInItsColour) {
  const Raster raster = raster_of(read_target(kTargets / "nested.yaml"), 2000, 0.01);
  EXPECT_EQ(raster.at({-0.505, 0}), 128);     // ground, which 0.5 rounds to
  EXPECT_EQ(raster.at({-0.45, 0.45}), 255);   // border
  EXPECT_EQ(raster.at({-0.3, 0}), 0);         // interior
  EXPECT_EQ(raster.at({0.01, 0.01}), 255);    // A, beside the hole
  EXPECT_EQ(raster.at({0.05, 0.125}), 0);     // hole: 0.045 to 0.205
  EXPECT_EQ(raster.at({0.065, 0.125}), 255);  // the inner border: 0.06 to 0.0795
  EXPECT_EQ(raster.at({0.085, 0.125}), 0);    // the inner interior
  EXPECT_EQ(raster.at({0.13, 0.13}), 255);    // the inner A, from the hole's centre to the upper right
  EXPECT_EQ(raster.at({0.12, 0.13}), 0);      // left of it
}

// Any layout: as many white pixels as the squares and the border have area, wherever they lie.
TEST(LandingTarget, RandomLayoutsArePaintedWithTheirOwnArea) {
  for (unsigned run = 0; run < 30; ++run) {
    TestRng rng(run);
    const int modules = 12 + rng.index(20), border = 1 + rng.index(3);
    std::ostringstream yaml;
    yaml << "size: 1.5\nmodules: " << modules << "\nborder: " << border << "\nsquares:\n";
    double white = modules * modules - (modules - 2 * border) * (modules - 2 * border);
    int squares = 0;
    // One square in each cell of three modules, one or two modules wide: never touching.
    for (int row = border + 1; row + 2 < modules - border; row += 3) {
      for (int column = border + 1; column + 2 < modules - border; column += 3) {
        if (squares > 0 && rng.uniform(0, 1) < 0.5) continue;
        const int side = 1 + rng.index(2);
        yaml << "  s" << 100 + squares++ << ": [" << column << ", " << row << ", " << side << "]\n";
        white += side * side;
      }
    }
    const LandingTarget target = read(yaml.str());
    EXPECT_EQ(target.features.size(), 4u * static_cast<size_t>(squares)) << "run " << run;
    const double per_module = 4;  // px: whole pixels, so that the count is exact
    const Raster raster = raster_of(target, per_module * modules / 1.5, 0);
    double painted = 0;
    for (const uint8_t grey : raster.grey) painted += grey / 255.0;
    // Corners within rounding of a pixel's edge take 1/255 of grey with them at most: three pixels in all
    // here.
    EXPECT_NEAR(painted, white * per_module * per_module, 3) << "run " << run << '\n' << yaml.str();
  }
}

// Whole modules, so that an occupancy grid can say independently what touches what.
TEST(LandingTarget, RandomPairsOfSquaresAreTakenExactlyWhenTheyKeepAModuleApart) {
  int taken = 0;
  for (unsigned run = 0; run < 400; ++run) {
    TestRng rng(run);
    const int a[3] = {2 + rng.index(8), 2 + rng.index(8), 1 + rng.index(4)};
    const int b[3] = {2 + rng.index(8), 2 + rng.index(8), 1 + rng.index(4)};
    bool grid[18][18] = {};
    for (int row = a[1] - 1; row <= a[1] + a[2]; ++row) {
      for (int column = a[0] - 1; column <= a[0] + a[2]; ++column) grid[row][column] = true;
    }
    bool touches = false;
    for (int row = b[1]; row < b[1] + b[2]; ++row) {
      for (int column = b[0]; column < b[0] + b[2]; ++column) touches = touches || grid[row][column];
    }
    std::ostringstream yaml;
    yaml << "size: 1\nmodules: 16\nborder: 1\nsquares:\n  A: [" << a[0] << ", " << a[1] << ", " << a[2]
         << "]\n  B: [" << b[0] << ", " << b[1] << ", " << b[2] << "]\n";
    EXPECT_EQ(error_of(yaml.str()) == "no error", !touches) << yaml.str();
    taken += touches ? 0 : 1;
  }
  // Both answers were asked for.
  EXPECT_GT(taken, 100);
  EXPECT_LT(taken, 350);
}

struct Slip {
  const char* line;
  const char* instead;
  const char* message;
};

void PrintTo(const Slip& slip, std::ostream* stream) { *stream << slip.instead; }

class BadTarget : public testing::TestWithParam<Slip> {};

TEST_P(BadTarget, IsRefusedWithItsPlaceAndCause) {
  EXPECT_EQ(error_of(sharp_with(GetParam().line, GetParam().instead)), GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    Slips, BadTarget,
    testing::Values(
        Slip{"size: 1\n", "",
             "t.yaml:1: size: expected the outer side of the white border in m, found nothing"},
        Slip{"size: 1\n", "size: 1000\n",
             "t.yaml:1: size: expected a number between 0.001 and 100, found \"1000\""},
        Slip{"size: 1\n", "size: .nan\n",
             "t.yaml:1: size: expected a number between 0.001 and 100, found \".nan\""},
        Slip{"modules: 20\n", "modules: 20.5\n",
             "t.yaml:2: modules: expected a whole number between 3 and 10000, found \"20.5\""},
        Slip{"modules: 20\n", "",
             "t.yaml:1: modules: expected the side of the drawing grid in modules, found nothing"},
        Slip{"border: 3", "border: 10",
             "t.yaml:3: border: expected less than half of the 20 modules, to leave an interior, found "
             "\"10\""},
        Slip{"border: 3", "border: 0", "t.yaml:3: border: expected a number above 0, found \"0\""},
        Slip{"A: [10, 10, 5]", "A: [10, 10]",
             "t.yaml:5: squares.A: expected a list of 3 numbers, found a list of 2"},
        Slip{"A: [10, 10, 5]", "A: [10, 10, 0]",
             "t.yaml:5: squares.A: expected a side above 0 modules, found 0"},
        Slip{"A: [10, 10, 5]", "A: [10, nan, 5]", "t.yaml:5: squares.A[1]: expected a number, found \"nan\""},
        Slip{"A: [10, 10, 5]", "A: [12, 10, 5]",
             "t.yaml:5: squares.A: expected a square between 3 and 17, clear of the border's inner edge, "
             "found "
             "columns 12 to 17, rows 10 to 15"},
        Slip{"D: [5, 5, 2]", "D: [5, 2, 2]",
             "t.yaml:8: squares.D: expected a square between 3 and 17, clear of the border's inner edge, "
             "found "
             "columns 5 to 7, rows 2 to 4"},
        Slip{"B: [5, 13, 2]", "B: [9, 13, 2]",
             "t.yaml:6: squares.B: expected a square clear of A (columns 10 to 15, rows 10 to 15), found "
             "columns 9 "
             "to 11, rows 13 to 15"},
        Slip{"F: [13, 5, 2]", "F: [11, 5, 2]",
             "t.yaml:10: squares.F: expected a square clear of E (columns 9 to 11, rows 5 to 7), found "
             "columns 11 to "
             "13, rows 5 to 7"},
        Slip{"F: [13, 5, 2]", "F: [11, 7, 2]",
             "t.yaml:10: squares.F: expected a square clear of E (columns 9 to 11, rows 5 to 7), found "
             "columns 11 to "
             "13, rows 7 to 9"},
        Slip{"F: [13, 5, 2]", "A: [13, 5, 2]",
             "t.yaml:10: squares.A: expected each key once, found it twice"},
        Slip{"in: A", "in: G", "t.yaml:12: nested.in: expected the label of one of the squares, found \"G\""},
        Slip{"  in: A\n", "",
             "t.yaml:11: nested.in: expected the label of one of the squares, found nothing"},
        Slip{"hole: 3.2", "hole: 5",
             "t.yaml:13: nested.hole: expected less than the side of square A, 5 modules, found \"5\""},
        Slip{"inner: 2.6", "inner: 3.2",
             "t.yaml:14: nested.inner: expected less than the hole, 3.2 modules, found \"3.2\""},
        Slip{"  F: [13, 5, 2]", "  a: [13, 5, 2]",
             "t.yaml:4: squares: expected labels in capital letters, as the inner target takes the small "
             "ones, found "
             "a"},
        Slip{"nested:", "nest:",
             "t.yaml:11: nest: expected one of border, modules, name, nested, outer_edge, size, squares, "
             "type, found "
             "an unknown key"},
        Slip{"size: 1\n", "size: 1\nouter_edge: torn\n",
             "t.yaml:2: outer_edge: expected one of printed, cut, found \"torn\""},
        Slip{"size: 1\n", "size: 1\ntype: circle\n",
             "t.yaml:2: type: expected one of squares, apriltag, found \"circle\""}));

TEST(LandingTarget, WithoutSquaresIsRefused) {
  EXPECT_EQ(error_of("size: 1\nmodules: 20\nborder: 3\nsquares: {}\n"),
            "t.yaml:4: squares: expected label: [column, row, side] of at least one square, found none");
}

TEST(LandingTarget, FilesThatAreNoneAreConfigErrors) {
  EXPECT_THROW(read_target(kTargets / "none.yaml"), ConfigError);
  EXPECT_THROW(read_target(kTargets), ConfigError);
}

}  // namespace
}  // namespace perch
