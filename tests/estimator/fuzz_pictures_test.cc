// Random pictures, as many as fit in a few seconds; PERCH_FUZZ_ROUNDS=100000 for a night. Each round has its
// number for a seed: a failure names the round, and PERCH_FUZZ_FIRST=number PERCH_FUZZ_ROUNDS=1 repeats it.

#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "perch/simulation/picture.h"
#include "support/drawing.h"
#include "support/random_picture.h"
#include "support/whole_frame.h"

namespace perch {
namespace {

int number_from(const char* variable, int otherwise) {
  const char* text = std::getenv(variable);
  return text ? std::atoi(text) : otherwise;
}

const CameraModel& camera_of_pieces() {
  static const CameraModel camera = CameraModel::pinhole(300, 300, 159.5, 119.5, 320, 240);
  return camera;
}

// The target's corners, 0.71 m from its middle, are all in front of the camera.
Rigid3 random_pose(TestRng& rng) {
  return looking_pose(rng.uniform(0.8, 6), rng.uniform(0, 1.2), rng.uniform(0, 6.3), rng.uniform(0, 6.3),
                      {rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5)});
}

// Rendered targets, whole and cut by the picture's edges, sharp and nested, to take pieces from.
const std::vector<cv::Mat>& rendered() {
  static const std::vector<cv::Mat> pictures = [] {
    TestRng rng;
    std::vector<cv::Mat> made;
    for (const char* target : {"sharp", "nested"}) {
      const Renderer renderer(camera_of_pieces(), run_config_of("paper", target).target);
      for (uint64_t i = 0; i < 10; ++i)
        made.push_back(Sensor().picture(renderer.radiance(random_pose(rng)), 1, i));
    }
    return made;
  }();
  return pictures;
}

cv::Rect random_part(TestRng& rng, const cv::Size& size) {
  const int x = rng.index(size.width), y = rng.index(size.height);
  return {x, y, 1 + rng.index(size.width - x), 1 + rng.index(size.height - y)};
}

cv::Mat random_ground(TestRng& rng, const cv::Size& size) {
  if (rng.index(3) == 0)
    return random_picture(rng, size.width, size.height, rng.index(100), 100 + rng.index(156));
  cv::Mat grey(size, CV_8UC1, cv::Scalar(rng.index(256)));
  if (rng.index(2) == 0) return grey;
  const double slope = rng.uniform(-1, 1), start = rng.uniform(0, 255);
  for (int u = 0; u < grey.cols; ++u) grey.col(u) = cv::saturate_cast<uint8_t>(start + slope * u);
  return grey;
}

// Convex and crossed, dots and larger than the picture, in any grey; some are squares in black ones.
void add_polygons(TestRng& rng, cv::Mat& grey, int count) {
  for (; count > 0; --count) {
    const double radius = std::exp(rng.uniform(0, 5)), turned = rng.uniform(0, 6.3);
    const cv::Point2d centre(rng.uniform(0, grey.cols), rng.uniform(0, grey.rows));
    const int corners = 3 + rng.index(4);
    std::vector<cv::Point> polygon;
    for (int k = 0; k < corners; ++k) {
      const double angle = turned + 2 * M_PI * k / corners, r = radius * rng.uniform(0.5, 1.2);
      polygon.emplace_back(centre + r * cv::Point2d(std::cos(angle), std::sin(angle)));
    }
    cv::fillPoly(grey, polygon, cv::Scalar(rng.index(3) == 0 ? rng.index(256) : 255 * rng.index(2)));
  }
}

// A part of a rendered picture anywhere, or the whole of it over most of the picture: those are found.
void paste_piece(TestRng& rng, cv::Mat& grey) {
  const auto& pictures = rendered();
  cv::Mat piece = pictures[static_cast<size_t>(rng.index(static_cast<int>(pictures.size())))];
  cv::Rect to = random_part(rng, grey.size());
  if (rng.index(2) == 0) {
    piece = piece(random_part(rng, piece.size()));
  } else if (grey.cols > 20 && grey.rows > 20) {
    to = cv::Rect(rng.index(grey.cols / 4), rng.index(grey.rows / 4), 3 * grey.cols / 4, 3 * grey.rows / 4);
  }
  cv::resize(piece, grey(to), to.size(), 0, 0, rng.index(2) == 0 ? cv::INTER_AREA : cv::INTER_LINEAR);
  if (rng.index(4) == 0) cv::flip(grey(to), grey(to), rng.index(3) - 1);
}

void spoil(TestRng& rng, cv::Mat& grey) {
  if (rng.index(3) == 0) cv::GaussianBlur(grey, grey, {}, rng.uniform(0.3, 3));
  if (rng.index(3) == 0) {
    cv::Mat noise(grey.size(), CV_16SC1), sum;
    const double sigma = std::exp(rng.uniform(0, 3.5));
    for (auto& value : cv::Mat_<int16_t>(noise)) value = static_cast<int16_t>(rng.normal(sigma));
    cv::add(grey, noise, sum, cv::noArray(), CV_16S);
    sum.convertTo(grey, CV_8U);
  }
  if (rng.index(10) == 0) grey = 255 - grey;
}

struct FuzzPicture {
  cv::Mat grey;
  bool pieces = false;  // of targets: what comes out may be a target
};

FuzzPicture random_fuzz(TestRng& rng) {
  constexpr int kMost = 320;
  // Most of a size where something can be found; some of the others.
  const int least = rng.index(5) == 0 ? 1 : 100;
  const cv::Size size(least + rng.index(kMost - least), least + rng.index(kMost - least));
  FuzzPicture picture{random_ground(rng, size), rng.index(2) == 0};
  add_polygons(rng, picture.grey, rng.index(picture.pieces ? 6 : 30));
  if (picture.pieces) {
    for (int count = 1 + rng.index(3); count > 0; --count) paste_piece(rng, picture.grey);
    add_polygons(rng, picture.grey, rng.index(3));
  }
  spoil(rng, picture.grey);
  return picture;
}

// Anything from what a filter says to what it never should: sure and wrong, unsure of everything, behind the
// camera, of rank 0, not a number.
std::optional<Prediction> random_prediction(TestRng& rng) {
  if (rng.index(4) == 0) return {};
  Prediction prediction;
  prediction.blur_px = rng.index(2) == 0 ? 0 : std::exp(rng.uniform(-3, 3));
  prediction.camera_from_target.mean = rng.index(4) == 0 ? rng.pose(5) : random_pose(rng);
  Eigen::Matrix<double, 6, 6> root;
  const double sigma = std::exp(rng.uniform(-12, 5));
  for (double& value : root.reshaped()) value = rng.normal(sigma);
  prediction.camera_from_target.covariance = root * root.transpose();
  if (rng.index(10) == 0) prediction.camera_from_target.covariance.setZero();
  if (rng.index(20) == 0) prediction.camera_from_target.covariance.setConstant(NAN);
  if (rng.index(20) == 0) prediction.camera_from_target.mean.translation.setConstant(NAN);
  return prediction;
}

// All that is not a time, bit for bit.
class Bytes {
 public:
  template <typename... T>
  explicit Bytes(const T&... values) {
    (add(values), ...);
  }
  bool operator==(const Bytes&) const = default;

 private:
  void add(double value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    text_.append(bytes, sizeof value);
  }
  void add(const Rigid3& pose) {
    for (const double value : pose.rotation.coeffs()) add(value);
    for (const double value : pose.translation) add(value);
  }
  void add(const PoseCovariance& covariance) {
    for (const double value : covariance.reshaped()) add(value);
  }
  void add(const std::vector<Correspondence>& list) {
    for (const auto& [feature, pixel, sigma] : list) {
      add(feature), add(pixel.x()), add(pixel.y()), add(sigma);
    }
  }
  std::string text_;
};

Bytes bytes_of(const Detection& d) {
  return Bytes(static_cast<int>(d.status), d.threshold, d.correspondences);
}
Bytes bytes_of(const Estimate& e) {
  return Bytes(static_cast<int>(e.status), e.camera_from_target.mean, e.camera_from_target.covariance,
               e.reprojection_rms_px, e.features, e.ambiguity, e.correspondences);
}

bool is_sound(const UncertainRigid3& pose) {
  return pose.mean.rotation.coeffs().allFinite() && pose.mean.translation.allFinite() &&
         pose.mean.translation.z() > 0 && pose.covariance.allFinite() &&
         pose.covariance.llt().info() == Eigen::Success;
}

class FuzzPictures : public testing::TestWithParam<std::string> {
 protected:
  // Rounds until a failure: the first says enough.
  template <typename Round>
  void each_round(int rounds, const Round& round) {
    const int first = number_from("PERCH_FUZZ_FIRST", 0);
    rounds = number_from("PERCH_FUZZ_ROUNDS", rounds);
    for (int i = first; i < first + rounds && !HasFailure(); ++i) {
      SCOPED_TRACE("round " + std::to_string(i));
      TestRng rng(static_cast<unsigned>(i));
      round(rng);
    }
  }
  RunConfig random_config(TestRng& rng) const {
    return run_config_of(GetParam(), rng.index(2) == 0 ? "sharp" : "nested");
  }
};

CameraModel camera_for(TestRng& rng, const cv::Mat& grey) {
  const double focal = rng.uniform(0.5, 1.5) * (grey.cols + grey.rows);
  return CameraModel::pinhole(focal, focal, 0.5 * (grey.cols - 1), 0.5 * (grey.rows - 1), grey.cols,
                              grey.rows);
}

// Estimates of the same frames by two estimators are the same bits, and where no piece of a target is, none
// is found.
TEST_P(FuzzPictures, GiveTheSameEstimateTwiceAndNoneWithoutATarget) {
  int ok = 0;
  each_round(1000, [&](TestRng& rng) {
    const FuzzPicture picture = random_fuzz(rng);
    const CameraModel camera = camera_for(rng, picture.grey);
    const RunConfig config = random_config(rng);
    Estimator one(config, camera), other(config, camera);
    Estimator::Aid aid;
    if (rng.index(2) == 0) aid.world_from_body = rng.rotation();
    // A target before it, half of the time: the estimator then expects one here.
    std::vector<Frame> frames{{33'000'000, picture.grey, "fuzz", {}, ""}};
    if (rng.index(2) == 0) {
      frames.insert(frames.begin(),
                    {0, picture_of(config.target, camera, random_pose(rng)), "before", {}, ""});
    }
    Estimate last;
    for (const Frame& frame : frames) {
      last = one.process(frame, aid);
      ASSERT_TRUE(bytes_of(last) == bytes_of(other.process(frame, aid)));
      ASSERT_TRUE(last.status != EstimateStatus::kOk || is_sound(last.camera_from_target));
    }
    ok += last.status == EstimateStatus::kOk;
    ASSERT_TRUE(picture.pieces || last.status != EstimateStatus::kOk);
  });
  if (!std::getenv("PERCH_FUZZ_ROUNDS")) {
    EXPECT_GE(ok, 5);  // enough is left of the targets to go all the way
  }
}

// A detector remembers nothing but the picture and the prediction, whatever came between.
TEST_P(FuzzPictures, GiveTheSameDetectionWhateverCameBetween) {
  each_round(300, [&](TestRng& rng) {
    const FuzzPicture picture = random_fuzz(rng), between = random_fuzz(rng);
    const CameraModel camera = camera_for(rng, picture.grey);
    const auto prediction = random_prediction(rng), for_between = random_prediction(rng);
    const auto detector = detector_of(random_config(rng), camera);
    const Bytes first = bytes_of(detector->detect(picture.grey, prediction));
    detector->detect(between.grey, for_between);
    ASSERT_TRUE(first == bytes_of(detector->detect(picture.grey, prediction)));
  });
}

INSTANTIATE_TEST_SUITE_P(Methods, FuzzPictures, testing::ValuesIn(kMethods),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace perch
