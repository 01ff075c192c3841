#include "calib/mount/mount_report.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "mount_world.h"

namespace perch {
namespace {

nlohmann::json data_of(const std::string& html) {
  const std::string start = "<script id=\"calibration\" type=\"application/json\">";
  const size_t at = html.find(start) + start.size();
  return nlohmann::json::parse(html.substr(at, html.find("</script>", at) - at));
}

TEST(MountReport, HoldsWhatThePageShowsAndNothingBreaksOutOfIt) {
  TestRng rng;
  MountWorld world;
  world.duration = 20;
  world.camera_rate = 5;
  MountProblem p = world.problem(rng);
  p.flights[0].name = "</script><b>";
  const MountSolution s = solve_mount(p);
  const auto held = cross_validate(p, s);
  const auto data = data_of(mount_report_html(p, s, held, "# mount"));
  EXPECT_EQ(data["parameters"].size(), 13u);
  EXPECT_EQ(data["correlation"].size(), 13u);
  for (size_t i = 0; i < 13; ++i) EXPECT_NEAR(data["correlation"][i][i], 1, 1e-9);
  EXPECT_EQ(data["effect"].size(), 3u);
  EXPECT_GT(data["offset_costs"].size(), 20u);
  const auto& flight = data["flights"][0];
  EXPECT_EQ(flight["name"], "</script><b>");
  EXPECT_EQ(flight["time_s"].size(), flight["used"]);
  EXPECT_EQ(flight["after"].size(), 6u);
  EXPECT_EQ(flight["after"][5].size(), flight["time_s"].size());
  EXPECT_EQ(flight["path"]["vision"].size(), flight["path"]["navigation"].size());
  // 10 degrees and 20 cm of mount are in the errors before, and not in those after.
  EXPECT_GT(flight["scatter_before"][0].get<double>(), 5 * flight["scatter_after"][0].get<double>());
}

TEST(CrossValidation, APartThatWasNotUsedIsPlacedAsTheOthersAre) {
  TestRng rng;
  MountWorld world = small_world();
  const MountProblem p = world.problem(rng);
  const MountSolution s = solve_mount(p);
  const auto held = cross_validate(p, s);
  ASSERT_EQ(held.size(), 3u);
  for (const HeldOut& part : held) {
    EXPECT_EQ(part.problem, "");
    EXPECT_EQ(part.within[0].count + part.beyond[0].count, pad_scatter(p, s, 0, s.state).count);
    EXPECT_LT(part.moved_sigmas, 4);
    EXPECT_LT(part.beyond[0].position, 1.4 * part.within[0].position);
    EXPECT_LT(part.beyond[0].rotation, 1.4 * part.within[0].rotation);
  }
}

}  // namespace
}  // namespace perch
