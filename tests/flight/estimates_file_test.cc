#include "perch/flight/estimates_file.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "support/near_pose.h"
#include "support/rng.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(EstimatesFile, HeadersAreThoseOfFormats) {
  EXPECT_EQ(
      estimates_header(),
      "timestamp [ns],status,x [m],y [m],z "
      "[m],q_w,q_x,q_y,q_z,cov_00,cov_01,cov_02,cov_03,cov_04,cov_05,cov_11,"
      "cov_12,cov_13,cov_14,cov_15,cov_22,cov_23,cov_24,cov_25,cov_33,cov_34,cov_35,cov_44,cov_45,cov_55,"
      "reprojection_rms [px],features,ambiguity,detect [us],pose [us],total [us]\n");
  EXPECT_EQ(states_header(),
            "timestamp [ns],x,y,z [m],q_w,q_x,q_y,q_z,v_x,v_y,v_z [m/s],w_x,w_y,w_z "
            "[rad/s],sigma_x,sigma_y,sigma_z,"
            "sigma_rx,sigma_ry,sigma_rz,sigma_vx,sigma_vy,sigma_vz,sigma_wx,sigma_wy,sigma_wz,source\n");
}

TEST(EstimatesFile, RowsAreThoseOfFormats) {
  Estimate estimate;
  estimate.timestamp_ns = 1700000000033333333;
  estimate.status = EstimateStatus::kOk;
  estimate.camera_from_target.mean = {Eigen::Quaterniond(-0.5, 0.5, -0.5, 0.5), {0.1, -2, 1e-7}};
  estimate.camera_from_target.covariance.setIdentity();
  estimate.camera_from_target.covariance(0, 5) = 0.25;
  estimate.reprojection_rms_px = 0.125;
  estimate.features = 24;
  estimate.ambiguity = 0.5;
  estimate.detect_us = 1234.56, estimate.pose_us = 7, estimate.total_us = 1250;
  std::string row;
  append_estimate(estimate, row);
  EXPECT_EQ(
      row,
      "1700000000033333333,ok,0.1,-2,1e-07,0.5,-0.5,0.5,-0.5,1,0,0,0,0,0.25,1,0,0,0,0,1,0,0,0,1,0,0,1,0,1,"
      "0.125,24,0.5,1234.6,7.0,1250.0\n");
  Estimate none;
  none.timestamp_ns = 5;
  row.clear();
  append_estimate(none, row);
  EXPECT_EQ(row, "5,no_target,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,0,,0.0,0.0,0.0\n");
  EXPECT_EQ(std::count(row.begin(), row.end(), ','), 35);

  VehicleState state;
  state.timestamp_ns = 6;
  state.pad_from_body.translation = {1, 2, 3};
  state.body_velocity_in_pad = {4, 5, 6};
  state.body_angular_velocity_in_pad = {7, 8, 9};
  for (int i = 0; i < 12; ++i) state.covariance(i, i) = i * i;
  state.source = StateSource::kPredicted;
  row.clear();
  append_state(state, row);
  EXPECT_EQ(row, "6,1,2,3,1,0,0,0,4,5,6,7,8,9,0,1,2,3,4,5,6,7,8,9,10,11,predicted\n");
}

TEST(EstimatesFile, TumKeepsEveryNanosecond) {
  std::string tum;
  append_tum(1700000000033333333, {Eigen::Quaterniond(-0.5, 0.5, -0.5, 0.5), {1, 2, 3}}, tum);
  append_tum(5, {}, tum);
  append_tum(-1'500'000'000, {}, tum);
  EXPECT_EQ(tum,
            "1700000000.033333333 1 2 3 -0.5 0.5 -0.5 0.5\n0.000000005 0 0 0 0 0 0 1\n-1.500000000 0 0 0 0 0 "
            "0 1\n");
}

std::vector<Estimate> random_estimates(TestRng& rng, int count) {
  std::vector<Estimate> estimates;
  for (int i = 0; i < count; ++i) {
    Estimate estimate;
    estimate.timestamp_ns = 1700000000000000000 + int64_t{i} * 33333333;
    estimate.status = static_cast<EstimateStatus>(rng.index(6));
    estimate.features = rng.index(30);
    estimate.ambiguity = rng.uniform(0, 1);
    estimate.total_us = rng.index(1000);
    if (estimate.status == EstimateStatus::kOk) {
      estimate.camera_from_target.mean = rng.pose(10);
      const PoseCovariance root = PoseCovariance::NullaryExpr([&] { return rng.normal(); });
      estimate.camera_from_target.covariance = root * root.transpose();
      estimate.camera_from_target.covariance.triangularView<Eigen::StrictlyLower>() =
          estimate.camera_from_target.covariance.transpose();
      estimate.reprojection_rms_px = rng.uniform(0, 1);
      estimate.pad_from_body = {rng.pose(10), PoseCovariance::Identity()};
    }
    if (i > 3) {
      estimate.state.emplace();
      estimate.state->timestamp_ns = estimate.timestamp_ns;
      estimate.state->pad_from_body = rng.pose(10);
      estimate.state->body_velocity_in_pad = rng.normal3();
      for (int k = 0; k < 12; ++k) estimate.state->covariance(k, k) = rng.uniform(0, 1);
      estimate.state->source = static_cast<StateSource>(rng.index(3));
    }
    estimates.push_back(estimate);
  }
  return estimates;
}

TEST(EstimatesFile, WhatIsReadAndWrittenAgainIsTheSameFile) {
  TestRng rng;
  const TempFolder folder;
  const auto estimates = random_estimates(rng, 200);
  write_estimates(folder / "estimates.csv", estimates);
  write_states(folder / "states.csv", estimates);
  write_pad_from_body(folder / "pad_from_body.tum", estimates);
  std::vector<std::string> problems;
  auto again = read_estimates(folder / "estimates.csv", problems);
  ASSERT_EQ(again.size(), estimates.size());
  for (size_t i = 0; i < again.size(); ++i) {
    EXPECT_EQ(again[i].timestamp_ns, estimates[i].timestamp_ns);
    EXPECT_EQ(again[i].status, estimates[i].status);
    EXPECT_EQ(again[i].camera_from_target.covariance, estimates[i].camera_from_target.covariance);
    EXPECT_EQ(again[i].camera_from_target.mean.translation, estimates[i].camera_from_target.mean.translation);
  }
  write_estimates(folder / "again.csv", again);
  EXPECT_EQ(read_file(folder / "again.csv"), read_file(folder / "estimates.csv"));

  const auto states = read_states(folder / "states.csv", problems);
  ASSERT_EQ(states.size(), estimates.size() - 4);
  EXPECT_EQ(states[0].timestamp_ns, estimates[4].timestamp_ns);
  std::string text = states_header();
  for (const auto& state : states) append_state(state, text);
  EXPECT_EQ(text, read_file(folder / "states.csv"));
  EXPECT_THAT(problems, IsEmpty());

  const std::string tum = read_file(folder / "pad_from_body.tum");
  EXPECT_EQ(
      std::count(tum.begin(), tum.end(), '\n'),
      std::count_if(estimates.begin(), estimates.end(), [](auto& e) { return e.pad_from_body.has_value(); }));
}

TEST(EstimatesFile, SkipsRowsThatCannotBeRead) {
  const TempFolder folder;
  std::string csv = estimates_header();
  append_estimate(Estimate{}, csv);
  csv += "7,okay,,\n8,ok,1,2\n9";
  const auto file = folder.write("estimates.csv", csv);
  std::vector<std::string> problems;
  EXPECT_EQ(read_estimates(file, problems).size(), 1U);
  EXPECT_THAT(problems, ElementsAre(HasSubstr("estimates.csv:3: status: expected one of the names"),
                                    HasSubstr("estimates.csv:4: z [m]: expected a number, found \"\""),
                                    HasSubstr("estimates.csv:5: status: ")));
  EXPECT_THROW(read_estimates(folder / "absent.csv", problems), std::runtime_error);
  EXPECT_THROW(read_states(file, problems), std::runtime_error);  // other columns
}

}  // namespace
}  // namespace perch
