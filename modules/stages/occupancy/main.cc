#include "stages/occupancy/occupancy_stage.h"

int main(int argc, char** argv) {
  return tessera::RunStage<tessera::OccupancyStage>(
      "occupancy", "Makes an occupancy map of what the keyframes see, and moves it along with them.", argc, argv);
}
