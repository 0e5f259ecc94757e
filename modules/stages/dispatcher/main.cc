#include "stages/dispatcher/dispatcher_stage.h"

int main(int argc, char** argv) {
  return tessera::RunStage<tessera::DispatcherStage>(
      "dispatcher", "Cuts frames into tiles and hands them to free extractors.", argc, argv);
}
