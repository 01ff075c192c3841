#include "perch/camera/zoom_table.h"

#include <gmock/gmock.h>

#include <cmath>

#include "support/config_error.h"
#include "support/rng.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

// A zoom lens: its focal length is proportional to the magnification, its barrel turns into a pincushion, its
// axis wanders by some pixels.
CameraModel lens_at(double zoom) {
  const double f = 500 * zoom, u = std::log(zoom);
  return CameraModel(
      "LENSMODEL_OPENCV4",
      {f, 1.001 * f, 640 + 6 * u, 360 - 3 * u * u, -0.2 + 0.15 * u, 0.05 - 0.02 * u, 1e-4 * u, 0}, 1280, 720);
}

ZoomTable table_of(std::initializer_list<double> zooms) {
  std::vector<ZoomEntry> entries;
  for (const double zoom : zooms) entries.push_back({zoom, lens_at(zoom)});
  return ZoomTable(entries);
}

TEST(ZoomTable, IsExactWhereTheCameraWasCalibrated) {
  const ZoomTable table = table_of({4, 1, 2, 8});
  for (const double zoom : {1.0, 2.0, 4.0, 8.0}) {
    const CameraModel found = table.at(zoom).value(), expected = lens_at(zoom);
    for (size_t k = 0; k < 8; ++k) {
      // exp(log f) rounds.
      EXPECT_NEAR(found.intrinsics()[k], expected.intrinsics()[k],
                  1e-12 * (1 + std::abs(expected.intrinsics()[k])));
    }
  }
}

TEST(ZoomTable, IsNearTheLensBetween) {
  // Zooms by a factor of 1.41 apart: below 0.5 %; 2 % by a factor of 2, in the interval at the table's end.
  const ZoomTable fine = table_of({1, 1.41, 2, 2.83, 4, 5.66, 8}), coarse = table_of({1, 2, 4, 8});
  for (double zoom = 1.45; zoom < 5.6; zoom *= 1.05) {
    const double f = lens_at(zoom).intrinsics()[0];
    EXPECT_NEAR(fine.at(zoom)->intrinsics()[0] / f, 1, 0.005) << zoom;
    EXPECT_NEAR(coarse.at(zoom)->intrinsics()[0] / f, 1, 0.025) << zoom;
  }
}

// What rises from entry to entry rises between them.
TEST(ZoomTable, AddsNoWavesOfItsOwn) {
  TestRng rng;
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<ZoomEntry> entries;
    double zoom = 1, f = 400, k1 = -0.3;
    for (int i = 0; i < 6; ++i) {
      entries.push_back({zoom, CameraModel("LENSMODEL_OPENCV4", {f, f, 320, 240, k1, 0, 0, 0}, 640, 480)});
      zoom += rng.uniform(0.05, 3);
      f *= rng.uniform(1, 3);
      k1 += rng.uniform(0, 0.2);
    }
    const ZoomTable table(entries);
    double last_f = 0, last_k1 = -1;
    for (int i = 0; i <= 500; ++i) {
      const double at = entries.front().zoom + (entries.back().zoom - entries.front().zoom) * i / 500;
      const std::vector<double> found = table.at(at)->intrinsics();
      EXPECT_GE(found[0], last_f * (1 - 1e-12));
      EXPECT_GE(found[4], last_k1 - 1e-12);
      last_f = found[0];
      last_k1 = found[4];
    }
  }
}

TEST(ZoomTable, SaysHowFarOffItIsWhereAnEntryIsHeldOut) {
  const auto fine = table_of({1, 1.41, 2, 2.83, 4}).held_out_px(),
             coarse = table_of({1, 2, 4, 8, 16}).held_out_px();
  ASSERT_EQ(fine.size(), 3U);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_GT(fine[i], 0.01);
    EXPECT_LT(fine[i], 25);
    EXPECT_GT(coarse[i], fine[i]);
  }
  EXPECT_TRUE(table_of({1, 2}).held_out_px().empty());
}

TEST(ZoomTable, KnowsNothingBeyondItsEnds) {
  const ZoomTable table = table_of({1, 2, 4});
  EXPECT_EQ(table.at(0.98)->intrinsics(), table.at(1)->intrinsics());  // an encoder's rounding
  EXPECT_FALSE(table.at(0.9));
  EXPECT_FALSE(table.at(4.1));
  EXPECT_FALSE(table.at(NAN));
}

TEST(ZoomTable, RefusesModelsThatDoNotGoTogether) {
  EXPECT_THROW(table_of({1}), std::invalid_argument);
  EXPECT_THROW(table_of({1, 1}), std::invalid_argument);
  EXPECT_THROW(ZoomTable({{1, lens_at(1)}, {2, CameraModel::pinhole(900, 900, 640, 360, 1280, 720)}}),
               std::invalid_argument);
  EXPECT_THROW(ZoomTable({{1, CameraModel::pinhole(900, 900, 640, 360, 640, 480)},
                          {2, CameraModel::pinhole(900, 900, 640, 360, 1280, 720)}}),
               std::invalid_argument);
}

std::string model_of(int f) {
  const std::string focal = std::to_string(f);
  return "{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [" + focal + ", " + focal +
         ", 319.5, 239.5], 'imagersize': [640, 480]}\n";
}

TEST(ZoomTable, IsWrittenEntryByEntryAndReadAgain) {
  const TempFolder folder;
  folder.write("wide.cameramodel", model_of(500));
  folder.write("models/tele.cameramodel", model_of(2000));
  folder.write("models/tele_again.cameramodel", model_of(2010));
  const auto file = folder / "zoom.yaml";
  add_to_zoom_table(file, 4, folder / "models/tele.cameramodel");
  EXPECT_THAT(config_error([&] { read_zoom_table(file); }), testing::HasSubstr("two zooms at least"));
  add_to_zoom_table(file, 1, folder / "wide.cameramodel");
  add_to_zoom_table(file, 4, folder / "models/tele_again.cameramodel");
  const ZoomTable table = read_zoom_table(file);
  ASSERT_EQ(table.entries().size(), 2U);
  EXPECT_EQ(table.entries()[0].zoom, 1);
  EXPECT_EQ(table.entries()[1].model.intrinsics()[0], 2010);
  EXPECT_NEAR(table.at(2.5)->intrinsics()[0], std::sqrt(500.0 * 2010), 1e-9);
}

TEST(ZoomTable, SaysWhereAFileIsWrong) {
  const TempFolder folder;
  const auto error = [&](const std::string& text) {
    return config_error([&] { read_zoom_table(folder.write("z.yaml", text)); });
  };
  EXPECT_THAT(error("modles: []\n"), testing::HasSubstr("models"));
  EXPECT_THAT(error("models:\n  - {zoom: far, model: a}\n"), testing::HasSubstr("z.yaml:2"));
  EXPECT_THAT(error("models:\n  - {zoom: 1}\n"), testing::HasSubstr("model"));
  EXPECT_THAT(error("models:\n  - {zoom: 1, model: nowhere.cameramodel}\n"),
              testing::HasSubstr("nowhere.cameramodel"));
}

}  // namespace
}  // namespace perch
