#include "stages/tracker/tracker_stage.h"

int main(int argc, char** argv) {
  return tessera::RunStage<tessera::TrackerStage>("tracker", "Estimates the pose of each frame and chooses keyframes.",
                                                  argc, argv);
}
