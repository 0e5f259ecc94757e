// The outcome of one solve of a bundle. Only this module's sources include this file.
#pragma once

namespace tessera {

struct BundleSummary {
  double initial_cost = 0.0;
  double final_cost = 0.0;
  int num_iterations = 0;
};

}  // namespace tessera
