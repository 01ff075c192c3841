#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "perch/detection/picture_model.h"
#include "perch/detection/plane_fit.h"

namespace perch {

struct PictureFitted {
  Eigen::Matrix3d image_from_plane = Eigen::Matrix3d::Identity();
  ImageFrame frame;
  PlaneInformation information = PlaneInformation::Zero();  // of a PlaneStep about it, the rest accounted for
  double growth = 0;                                        // px
  double rms_px = 0;    // of the grey levels left, as a shift of the edges that they would be
  double together = 1;  // pixels that err alike, which the information counts as one
  int pixels = 0;       // that an edge crosses
};

// Fits the picture of a small target to its grey levels: the homography, blur, growth of white, and the
// levels of white, black and ground, by Gauss and Newton with Cauchy's loss. Where squares are but a few
// pixels wide their edges bleed into each other and cannot be measured one by one; all of them together still
// can.
class PictureFit {
 public:
  PictureFit(const TargetEdges& edges, const CameraModel& camera) : model_(edges, camera) {}

  // From a homography that is right to a third of a square. Empty when the target is not wholly in the
  // picture, or what was found is not what was asked for: white, black and a picture that they explain.
  std::optional<PictureFitted> fit(const cv::Mat& grey, const Eigen::Matrix3d& image_from_plane, double size,
                                   double blur_px, double contrast);

  // Whether the last one was not wholly in the picture, with a little ground around it.
  bool is_outside() const { return is_outside_; }

 private:
  struct Noise {
    double pixel = 4, ground = 0;  // variance of a pixel; of the ground's texture, grey levels squared
    double together = 4;           // as texture_together
  };
  struct Pass;
  Pass take(const cv::Mat& grey, const Noise& noise, bool levels_only);
  static Noise noise_of(const Pass& pass);
  static double lengthening(const Pass& pass);
  static double together(const Pass& pass);

  PictureModel model_;
  bool is_outside_ = false;
};

}  // namespace perch
