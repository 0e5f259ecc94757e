#include "stages/recorder/recorder_stage.h"

int main(int argc, char** argv) {
  return tessera::RunStage<tessera::RecorderStage>("recorder", "Records all channels of all buses into one LCM log.", argc, argv);
}
