#include "stages/loop_closer/loop_closer_stage.h"

int main(int argc, char** argv) {
  return tessera::RunStage<tessera::LoopCloserStage>(
      "loop_closer", "Recognizes places seen before, and finds a lost camera again.", argc, argv);
}
