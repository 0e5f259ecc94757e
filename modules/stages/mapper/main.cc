#include "stages/mapper/mapper_stage.h"

int main(int argc, char** argv) {
  return tessera::RunStage<tessera::MapperStage>("mapper", "Owns the map: extends and improves it with each keyframe.",
                                                 argc, argv);
}
