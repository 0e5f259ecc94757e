#include "stages/global_adjuster/global_adjuster_stage.h"

int main(int argc, char** argv) {
  return tessera::RunStage<tessera::GlobalAdjusterStage>("global_adjuster",
                                                         "Adjusts the whole map when a loop was closed.", argc, argv);
}
