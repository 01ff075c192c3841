#include "perch/station/hello.h"

#include <gtest/gtest.h>

#include "support/sharp_target.h"

namespace perch {
namespace {

using Json = nlohmann::json;

StationScene scene() {
  return {
      sharp_target(), CameraModel::pinhole(400, 400, 319.5, 239.5, 640, 480), {}, "sim:landing.yaml", false};
}

TEST(Hello, SaysWhatAPageNeedsToReadARowAndDrawTheScene) {
  StationScene what = scene();
  what.frames.world_from_pad = Rigid3{};
  what.frames.body_from_base = Rigid3{Eigen::Quaterniond::Identity(), {0.1, 0.2, 0.3}};
  StationOptions options;
  options.bandwidth = 64;
  const Json hello = hello_json(what, options);
  EXPECT_EQ(hello["columns"].size(), size_t{StateRow::kValues});
  EXPECT_EQ(hello["row_bytes"], kStateRowBytes);
  EXPECT_EQ(hello["bandwidth"], 64);
  EXPECT_EQ(hello["control"], false);
  EXPECT_EQ(hello["compared"], true);
  EXPECT_EQ(hello["pan_tilt"], nullptr);
  EXPECT_EQ(hello["body_from_base"], (Json{0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0}));
  // The picture's upper left corner, by hand: half a pixel outside of the first pixel's middle.
  const Json& ray = hello["camera"]["rays"][0];
  EXPECT_NEAR(ray[0].get<double>() / ray[2].get<double>(), -320.0 / 400, 1e-12);
  EXPECT_NEAR(ray[1].get<double>() / ray[2].get<double>(), -240.0 / 400, 1e-12);
}

TEST(Hello, SaysHowTheHeadTurnsTheCamera) {
  StationScene what = scene();
  PanTilt& head = what.frames.pan_tilt.emplace();
  head.base_from_zero.translation = {0, 0, 0.05};
  head.tilt.scale = -1;
  head.tilt.point = {0, 0.01, 0};
  head.tilt.zero = 0.5;
  head.order = HeadOrder::kTiltCarriesPan;
  const Json hello = hello_json(what, StationOptions{});
  EXPECT_EQ(hello["base_from_camera"], (Json{0.0, 0.0, 0.05, 1.0, 0.0, 0.0, 0.0}));
  const Json& pan_tilt = hello["pan_tilt"];
  EXPECT_EQ(pan_tilt["pan"]["direction"], (Json{0.0, 1.0, 0.0}));
  EXPECT_EQ(pan_tilt["tilt"]["direction"], (Json{1.0, 0.0, 0.0}));
  EXPECT_EQ(pan_tilt["tilt"]["point"], (Json{0.0, 0.01, 0.0}));
  EXPECT_EQ(pan_tilt["tilt"]["scale"], -1);
  EXPECT_DOUBLE_EQ(pan_tilt["tilt"]["zero_deg"].get<double>(), 28.64788975654116);  // 0.5 rad
  EXPECT_EQ(pan_tilt["pan_carries_tilt"], false);
}

}  // namespace
}  // namespace perch
