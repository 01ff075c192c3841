#include "perch/target/print.h"

#include <cairo.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <set>

#include "support/temp_folder.h"

namespace perch {
namespace {

namespace fs = std::filesystem;

const LandingTarget& sharp() {
  static const LandingTarget target =
      read_target(fs::path(PERCH_SOURCE_DIR) / "configs" / "targets" / "sharp.yaml");
  return target;
}

// A target small enough for one page of A4: fast to draw at any resolution.
LandingTarget small_tag() {
  return read_target(
      Section::parse("type: apriltag\nfamily: tag36h11\ntags: [{id: 0, size: 0.08}]\n", "t.yaml"));
}

int count(const std::string& text, const std::string& what) {
  int n = 0;
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
  return n;
}

std::string error_of(const LandingTarget& target, const fs::path& output, const PrintOptions& options) {
  try {
    print_target(target, output, options);
  } catch (const std::exception& e) {
    return e.what();
  }
  return "no error";
}

class Print : public testing::Test {
 protected:
  std::set<std::string> names() const {
    std::set<std::string> found;
    for (const auto& entry : fs::directory_iterator(folder_.path()))
      found.insert(entry.path().filename().string());
    return found;
  }
  TempFolder folder_;
};

TEST_F(Print, APdfIsOnePageOfTheTargetsSize) {
  print_target(sharp(), folder_ / "pad.pdf", {});
  const std::string pdf = read_file(folder_ / "pad.pdf");
  EXPECT_EQ(pdf.substr(0, 5), "%PDF-");
  EXPECT_EQ(count(pdf, "/Type /Page %"), 1);
  const SheetPlan plan = plan_sheets(printed_bounds(sharp()), Paper::kNone);
  double box[4] = {};
  ASSERT_EQ(std::sscanf(pdf.c_str() + pdf.find("/MediaBox"), "/MediaBox [ %lf %lf %lf %lf", &box[0], &box[1],
                        &box[2], &box[3]),
            4);
  // Points; cairo writes six decimals.
  EXPECT_NEAR(box[2] - box[0], plan.page.width * 72 / 25.4, 1e-5);
  EXPECT_NEAR(box[3] - box[1], plan.page.height * 72 / 25.4, 1e-5);
}

TEST_F(Print, ATiledPdfHasAnOverviewAndAPageForEachTile) {
  EXPECT_THAT(print_target(sharp(), folder_ / "pad.pdf", {.paper = Paper::kA4}),
              testing::ElementsAre(folder_ / "pad.pdf"));
  const std::string pdf = read_file(folder_ / "pad.pdf");
  EXPECT_EQ(count(pdf, "/Type /Page %"), 1 + 24);
  EXPECT_EQ(count(pdf, "/MediaBox [ 0 0 595.275591 841.889764 ]"), 1 + 24);
}

TEST_F(Print, TilesOfOtherKindsAreFilesOfTheirOwn) {
  const auto written = print_target(sharp(), folder_ / "pad.svg", {.paper = Paper::kA3});
  EXPECT_EQ(written.size(), 1u + 12u);
  EXPECT_EQ(written.front(), folder_ / "pad-overview.svg");
  EXPECT_EQ(written.back(), folder_ / "pad-r3c4.svg");
  EXPECT_EQ(names().size(), written.size());  // nothing is left aside
  EXPECT_NE(read_file(written[1]).find("width=\"297mm\" height=\"420mm\""), std::string::npos);
}

TEST_F(Print, ASmallTargetIsOneFileOnPaperToo) {
  EXPECT_THAT(print_target(small_tag(), folder_ / "tag.svg", {.paper = Paper::kA4}),
              testing::ElementsAre(folder_ / "tag.svg"));
}

TEST_F(Print, APngHasThePixelsAndTheResolutionAskedFor) {
  print_target(small_tag(), folder_ / "tag.png", {.dpi = 254, .bare = true});
  // Bare: 10 modules of 0.01 m, 10 px a mm.
  cairo_surface_t* surface = cairo_image_surface_create_from_png((folder_ / "tag.png").c_str());
  ASSERT_EQ(cairo_surface_status(surface), CAIRO_STATUS_SUCCESS);
  EXPECT_EQ(cairo_image_surface_get_width(surface), 1000);
  EXPECT_EQ(cairo_image_surface_get_height(surface), 1000);
  cairo_surface_destroy(surface);
  // 10 000 pixels per metre, twice, then the unit; the CRC is what Python's zlib.crc32 says.
  const std::string chunk("\0\0\0\x09pHYs\0\0\x27\x10\0\0\x27\x10\x01", 17);
  const std::string png = read_file(folder_ / "tag.png");
  const size_t at = png.find(chunk);
  ASSERT_EQ(at, 33u);
  EXPECT_EQ(png.substr(at + 17, 4), std::string("\x94\x69\x51\x19", 4));
}

TEST_F(Print, AFolderThatIsNotThereIsNamed) {
  const fs::path file = folder_ / "none" / "pad.pdf";
  EXPECT_EQ(error_of(small_tag(), file, {}),
            file.string() + ": cannot be written: No such file or directory");
}

TEST_F(Print, AFolderIsNoOutput) {
  fs::create_directory(folder_ / "pad.pdf");
  EXPECT_EQ(error_of(small_tag(), folder_ / "pad.pdf", {}),
            (folder_ / "pad.pdf").string() + ": cannot be written: Is a directory");
}

TEST_F(Print, AFullDiskIsAnErrorAndLeavesTheOldFile) {
  // The file aside is a link to a disk that is always full.
  const fs::path file = folder_ / "pad.pdf";
  std::ofstream(file) << "old";
  fs::create_symlink("/dev/full", file.string() + ".part");
  // Else the file is the full disk itself, which reads without end.
  ASSERT_EQ(error_of(small_tag(), file, {}), file.string() + ": cannot be written: No space left on device");
  EXPECT_EQ(read_file(file), "old");
  EXPECT_THAT(names(), testing::ElementsAre("pad.pdf"));
}

TEST_F(Print, WhatIsTooLargeIsRefusedBeforeAnythingIsWritten) {
  LandingTarget huge = small_tag();
  for (Patch& patch : huge.patches) {
    for (Eigen::Vector2d& corner : patch.corners) corner *= 60;
  }
  EXPECT_THAT(error_of(huge, folder_ / "pad.pdf", {}),
              testing::HasSubstr("a PDF page is at most 5080 mm long"));
  EXPECT_THAT(error_of(huge, folder_ / "pad.png", {.dpi = 300}), testing::HasSubstr("at most 32767 pixels"));
  EXPECT_TRUE(names().empty());
}

TEST_F(Print, UnknownKindsAndABareTargetOnPaperAreRefused) {
  EXPECT_THROW(print_target(small_tag(), folder_ / "pad.jpg", {}), std::invalid_argument);
  EXPECT_THROW(print_target(small_tag(), folder_ / "pad", {}), std::invalid_argument);
  EXPECT_THROW(print_target(small_tag(), folder_ / "pad.pdf", {.paper = Paper::kA4, .bare = true}),
               std::invalid_argument);
}

}  // namespace
}  // namespace perch
