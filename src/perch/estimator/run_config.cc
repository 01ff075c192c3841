#include "perch/estimator/run_config.h"

namespace perch {

RunConfig read_run_config(Section root) {
  RunConfig config;
  if (!root.has("target")) root.fail("target", "the path of a target file");
  std::filesystem::path target;
  root.read("target", target);
  config.target = read_target(target);

  Section camera = root.section("camera");
  camera.read("source", config.source);
  if (camera.has("model")) camera.read("model", config.camera_model);
  camera.read_choice("channel", config.channel,
                     {{"grey", Channel::kGrey},
                      {"red", Channel::kRed},
                      {"green", Channel::kGreen},
                      {"blue", Channel::kBlue}});
  camera.done();

  config.frames = read_frame_chain(root.section("frames"));
  config.detection = read_detection_options(root.section("detection"));
  config.pose = read_pose_options(root.section("pose"));
  config.tracking = read_tracking_options(root.section("tracking"));
  // The live program's: a batch run reads the same file and leaves them alone.
  std::string nav = "flight";
  root.read("nav", nav);
  root.section("outputs");
  root.done();
  return config;
}

}  // namespace perch
