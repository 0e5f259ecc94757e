#include "stages/extractor/extractor_stage.h"

int main(int argc, char** argv) {
  return tessera::RunStage<tessera::ExtractorStage>(
      "extractor", "Detects and describes keypoints in the tiles it is given.", argc, argv);
}
