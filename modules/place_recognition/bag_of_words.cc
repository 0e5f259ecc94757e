#include "place_recognition/bag_of_words.h"

#include <algorithm>

namespace tessera {

double Similarity(const BagOfWords& a, const BagOfWords& b) {
  double sum = 0.0;
  auto of_a = a.words.begin();
  auto of_b = b.words.begin();
  while (of_a != a.words.end() && of_b != b.words.end()) {
    if (of_a->first < of_b->first) {
      ++of_a;
    } else if (of_b->first < of_a->first) {
      ++of_b;
    } else {
      sum += static_cast<double>(std::min(of_a->second, of_b->second));
      ++of_a;
      ++of_b;
    }
  }
  return std::min(sum, 1.0);  // the weights are rounded
}

}  // namespace tessera
