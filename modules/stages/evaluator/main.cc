#include "stages/evaluator/evaluator_stage.h"

int main(int argc, char** argv) {
  return tessera::RunStage<tessera::EvaluatorStage>("evaluator", "Writes the trajectory and the figures of a run.",
                                                    argc, argv);
}
