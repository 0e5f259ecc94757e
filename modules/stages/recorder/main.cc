#include "stages/recorder/recorder_stage.h"

int main(int argc, char** argv) {
  return tessera::RunStage<tessera::RecorderStage>("recorder", "Writes everything that is said into an LCM log.", argc,
                                                   argv);
}
