#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace perch {

struct GroundOptions {
  double reflectance = 0.18;  // mean: asphalt 0.1, grass 0.2, concrete 0.4
  double contrast = 0.25;     // standard deviation over mean
  int stones = 12;            // brighter and darker ones on each 8 m x 8 m
  uint64_t seed = 1;
};

// What lies around the target: noise of several octaves from metres to millimetres (each of half the scale of
// the one before, and 0.7 of its amplitude) and stones. A function of the place in the target's plane, so
// that it moves in the picture as a ground does. Repeats every 8 m.
class Ground {
 public:
  explicit Ground(const GroundOptions& options);

  // The reflectance around a point, averaged over about `size` m.
  double reflectance(const Eigen::Vector2d& point, double size) const;

 private:
  // A square picture that repeats without a seam; each level has half the resolution of the one before.
  struct Tile {
    double side = 1;  // m
    std::vector<cv::Mat_<float>> levels;

    void add_coarser_levels();
    double at(const Eigen::Vector2d& point, double size) const;
  };

  Tile wide_;  // reflectance
  Tile fine_;  // a factor about 1
};

}  // namespace perch
