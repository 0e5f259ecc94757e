#include "stages/map_writer/map_writer_stage.h"

int main(int argc, char** argv) {
  return tessera::RunStage<tessera::MapWriterStage>(
      "map_writer", "Joins a running stack, and writes its map as a cloud of points, or its occupancy map.", argc,
      argv);
}
