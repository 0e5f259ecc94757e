#include "place_recognition/vocabulary_training.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>
#include <stdexcept>
#include <utility>

namespace tessera {
namespace {

constexpr size_t kNumBits = 256;
constexpr size_t kWordBits = 64;

struct Cluster {
  Descriptor center;
  std::vector<Descriptor> members;
};

// How many descriptors of a set have each bit.
class BitCounter {
 public:
  void Add(const Descriptor& descriptor) {
    for (size_t word = 0; word < descriptor.size(); ++word) {
      for (size_t bit = 0; bit < kWordBits; ++bit) {
        counts_[word * kWordBits + bit] += static_cast<uint32_t>((descriptor[word] >> bit) & 1U);
      }
    }
    ++num_descriptors_;
  }
  uint32_t num_descriptors() const { return num_descriptors_; }
  // Of a tie, the bit is 0.
  Descriptor Majority() const {
    Descriptor majority{};
    for (size_t i = 0; i < kNumBits; ++i) {
      if (2 * counts_[i] > num_descriptors_) majority[i / kWordBits] |= uint64_t{1} << (i % kWordBits);
    }
    return majority;
  }

 private:
  std::array<uint32_t, kNumBits> counts_{};
  uint32_t num_descriptors_ = 0;
};

// The first index at which the sum of the weights up to and with it exceeds `target`.
size_t IndexAtSum(const std::vector<int>& weights, uint64_t target) {
  uint64_t sum = 0;
  for (size_t i = 0; i < weights.size(); ++i) {
    sum += static_cast<uint64_t>(weights[i]);
    if (sum > target) return i;
  }
  throw std::logic_error("the weights sum up to less than the target");
}

// Squared distances from the nearest center when one more joins.
std::vector<int> Join(const std::vector<Descriptor>& members, const Descriptor& center, std::vector<int> squared) {
  for (size_t i = 0; i < members.size(); ++i) {
    const int distance = HammingDistance(members[i], center);
    squared[i] = std::min(squared[i], distance * distance);
  }
  return squared;
}

uint64_t Sum(const std::vector<int>& values) { return std::accumulate(values.begin(), values.end(), uint64_t{0}); }

// At most k centers, all different. Each is the best of a few drawn ones: a single draw often puts two into one
// cluster.
std::vector<Descriptor> ChooseCenters(const std::vector<Descriptor>& members, int k, std::mt19937_64& generator) {
  constexpr int kNumDraws = 4;
  std::vector<Descriptor> centers{members[generator() % members.size()]};
  std::vector<int> squared(members.size(), static_cast<int>(kNumBits * kNumBits));
  squared = Join(members, centers[0], std::move(squared));
  uint64_t sum = Sum(squared);
  while (centers.size() < static_cast<size_t>(k) && sum > 0) {  // 0: every member is a center
    Descriptor best{};
    std::vector<int> best_squared;
    uint64_t best_sum = sum;
    for (int draw = 0; draw < kNumDraws; ++draw) {
      const Descriptor& drawn = members[IndexAtSum(squared, generator() % sum)];
      std::vector<int> joined = Join(members, drawn, squared);
      const uint64_t joined_sum = Sum(joined);
      if (joined_sum >= best_sum) continue;
      best = drawn;
      best_sum = joined_sum;
      best_squared = std::move(joined);
    }
    centers.push_back(best);
    squared = std::move(best_squared);
    sum = best_sum;
  }
  return centers;
}

uint8_t NearestCenter(const std::vector<Descriptor>& centers, const Descriptor& descriptor) {
  size_t nearest = 0;
  int least_distance = HammingDistance(centers[0], descriptor);
  for (size_t i = 1; i < centers.size(); ++i) {
    const int distance = HammingDistance(centers[i], descriptor);
    if (distance < least_distance) {
      least_distance = distance;
      nearest = i;
    }
  }
  return static_cast<uint8_t>(nearest);
}

// Moves the centers to where they are the majority of their members; one without members stays.
void MoveCenters(const std::vector<Descriptor>& members, const std::vector<uint8_t>& assignment,
                 std::vector<Descriptor>& centers) {
  std::vector<BitCounter> counters(centers.size());
  for (size_t i = 0; i < members.size(); ++i) counters[assignment[i]].Add(members[i]);
  for (size_t c = 0; c < centers.size(); ++c) {
    if (counters[c].num_descriptors() > 0) centers[c] = counters[c].Majority();
  }
}

// The parts of a node, none empty. Members are with the nearest of the centers, as they will be when words are looked
// up.
std::vector<Cluster> Split(const std::vector<Descriptor>& members, const VocabularyOptions& options,
                           std::mt19937_64& generator) {
  std::vector<Descriptor> centers = ChooseCenters(members, options.num_children, generator);
  std::vector<uint8_t> assignment(members.size());
  const auto assign = [&](const Descriptor& member) { return NearestCenter(centers, member); };
  std::transform(members.begin(), members.end(), assignment.begin(), assign);
  for (int iteration = 0; iteration < options.max_num_iterations; ++iteration) {
    MoveCenters(members, assignment, centers);
    const std::vector<uint8_t> previous = assignment;
    std::transform(members.begin(), members.end(), assignment.begin(), assign);
    if (assignment == previous) break;
  }
  std::vector<Cluster> clusters;
  for (const Descriptor& center : centers) clusters.push_back({center, {}});
  for (size_t i = 0; i < members.size(); ++i) clusters[assignment[i]].members.push_back(members[i]);
  std::erase_if(clusters, [](const Cluster& cluster) { return cluster.members.empty(); });
  return clusters;
}

bool AreAllEqual(const std::vector<Descriptor>& members) {
  return std::all_of(members.begin(), members.end(), [&](const Descriptor& member) { return member == members[0]; });
}

// idf = ln(N / N_w) of each word, N_w being the number of images that hold it.
std::vector<float> MeasureIdf(const VocabularyTree& tree, const std::vector<std::vector<Descriptor>>& images) {
  const Vocabulary vocabulary([&] {
    VocabularyTree unweighted = tree;
    unweighted.idf.assign(static_cast<size_t>(std::count(tree.num_children.begin(), tree.num_children.end(), 0)), 1.0F);
    return unweighted;
  }());
  std::vector<int> num_holders(static_cast<size_t>(vocabulary.num_words()), 0);
  for (const std::vector<Descriptor>& image : images) {
    for (const auto& [word, weight] : vocabulary.Describe(image).words) ++num_holders[static_cast<size_t>(word)];
  }
  std::vector<float> idf;
  for (const int holders : num_holders) {
    idf.push_back(static_cast<float>(std::log(static_cast<double>(images.size()) / std::max(holders, 1))));
  }
  return idf;
}

}  // namespace

Result<> VocabularyOptions::Check() const {
  if (num_children < 2 || num_children > VocabularyTree::kMaxChildren)
    return Failed("a node must have 2 to 255 children");
  if (num_levels < 1 || num_levels > 10) return Failed("a vocabulary must have 1 to 10 levels");
  if (direct_level < 0 || direct_level > num_levels)
    return Failed("the direct index must be in one of the vocabulary's levels");
  if (max_num_iterations < 1) return Failed("a split takes at least one iteration");
  return {};
}

VocabularyTree TrainVocabulary(const std::vector<std::vector<Descriptor>>& images, const VocabularyOptions& options) {
  ThrowIfFailed<std::invalid_argument>(options.Check());
  std::vector<Cluster> level(1);  // the nodes of one level of the tree
  for (const std::vector<Descriptor>& image : images) {
    level[0].members.insert(level[0].members.end(), image.begin(), image.end());
  }
  if (level[0].members.empty()) throw std::invalid_argument("there are no descriptors to learn from");
  std::mt19937_64 generator(options.seed);
  VocabularyTree tree;
  tree.direct_level = options.direct_level;
  for (int depth = 0; !level.empty(); ++depth) {
    std::vector<Cluster> next_level;
    for (Cluster& node : level) {
      std::vector<Cluster> parts;
      if (depth < options.num_levels && !AreAllEqual(node.members)) parts = Split(node.members, options, generator);
      tree.centers.push_back(node.center);
      tree.num_children.push_back(static_cast<uint8_t>(parts.size()));
      std::move(parts.begin(), parts.end(), std::back_inserter(next_level));
      node.members = {};
    }
    level = std::move(next_level);
  }
  tree.idf = MeasureIdf(tree, images);
  return tree;
}

}  // namespace tessera
