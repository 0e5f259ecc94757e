#include "stages/reassembler/reassembler_stage.h"

int main(int argc, char** argv) {
  return tessera::RunStage<tessera::ReassemblerStage>(
      "reassembler", "Joins the candidates of tiles to the features of frames, in order.", argc, argv);
}
