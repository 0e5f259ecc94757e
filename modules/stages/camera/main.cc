#include "stages/camera/camera_stage.h"

int main(int argc, char** argv) {
  return tessera::RunStage<tessera::CameraStage>("camera", "Publishes the frames of a data set, video, camera or log.",
                                                 argc, argv);
}
