#include "place_recognition/vocabulary.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <utility>

namespace tessera {
namespace {

// Words in ascending order with how often they occur.
std::vector<std::pair<int32_t, int32_t>> CountWords(std::vector<int32_t> words) {
  std::sort(words.begin(), words.end());
  std::vector<std::pair<int32_t, int32_t>> counts;
  for (const int32_t word : words) {
    if (counts.empty() || counts.back().first != word) counts.emplace_back(word, 0);
    ++counts.back().second;
  }
  return counts;
}

std::vector<std::pair<int32_t, float>> WeighWords(const std::vector<std::pair<int32_t, int32_t>>& counts,
                                                  const std::vector<float>& idf) {
  const auto weight_of = [&](const std::pair<int32_t, int32_t>& count) {
    return static_cast<double>(count.second) * static_cast<double>(idf[static_cast<size_t>(count.first)]);
  };
  double sum = 0.0;
  for (const auto& count : counts) sum += weight_of(count);
  std::vector<std::pair<int32_t, float>> words;
  for (const auto& count : counts) {
    const double weight = weight_of(count);
    if (weight > 0.0) words.emplace_back(count.first, static_cast<float>(weight / sum));
  }
  return words;
}

}  // namespace

Result<> VocabularyTree::Check() const {
  if (num_children.empty() || num_children.size() != centers.size())
    return Failed("the numbers of its nodes and centers differ");
  int64_t num_reached = 1;  // the root
  size_t num_words = 0;
  for (size_t node = 0; node < num_children.size(); ++node) {
    if (num_reached <= static_cast<int64_t>(node)) return Failed("its nodes do not form one tree");
    num_reached += num_children[node];
    num_words += num_children[node] == 0 ? 1 : 0;
  }
  if (num_reached != static_cast<int64_t>(num_children.size())) return Failed("its nodes do not form one tree");
  if (num_words != idf.size()) return Failed("the numbers of its words and weights differ");
  const bool are_weights_good =
      std::all_of(idf.begin(), idf.end(), [](float weight) { return std::isfinite(weight) && weight >= 0.0F; });
  if (!are_weights_good) return Failed("a weight is negative or not finite");
  if (direct_level < 0) return Failed("the level of its direct index is negative");
  return {};
}

Vocabulary::Vocabulary(VocabularyTree tree) : tree_(std::move(tree)) {
  ThrowIfFailed<std::invalid_argument>(tree_.Check());
  int32_t next_child = 1;
  int32_t next_word = 0;
  first_child_.reserve(tree_.num_children.size());
  for (const uint8_t num_children : tree_.num_children) {
    first_child_.push_back(num_children > 0 ? next_child : next_word++);
    next_child += num_children;
  }
}

// The least of distance * 256 + child: no branch to be mispredicted.
size_t Vocabulary::NearestChild(size_t node, const Descriptor& descriptor) const {
  static_assert(VocabularyTree::kMaxChildren < 256);
  const auto first = static_cast<size_t>(first_child_[node]);
  const Descriptor* centers = tree_.centers.data() + first;
  uint32_t nearest = std::numeric_limits<uint32_t>::max();
  for (uint32_t child = 0; child < tree_.num_children[node]; ++child) {
    nearest = std::min(nearest, static_cast<uint32_t>(HammingDistance(descriptor, centers[child])) << 8 | child);
  }
  return first + (nearest & 0xff);
}

// All descriptors go down together, level by level: while one waits for memory, others go on.
std::vector<Vocabulary::Leaf> Vocabulary::FindLeaves(const std::vector<Descriptor>& descriptors) const {
  std::vector<size_t> nodes(descriptors.size(), 0);
  std::vector<Leaf> leaves(descriptors.size(), Leaf{0, 0});
  bool goes_on = true;
  for (int32_t level = 1; goes_on; ++level) {
    goes_on = false;
    for (size_t i = 0; i < descriptors.size(); ++i) {
      if (tree_.num_children[nodes[i]] == 0) continue;
      nodes[i] = NearestChild(nodes[i], descriptors[i]);
      if (level <= tree_.direct_level) leaves[i].direct_node = static_cast<int32_t>(nodes[i]);
      goes_on = true;
    }
  }
  for (size_t i = 0; i < descriptors.size(); ++i) leaves[i].word = first_child_[nodes[i]];
  return leaves;
}

BagOfWords Vocabulary::Describe(const std::vector<Descriptor>& descriptors) const {
  const std::vector<Leaf> leaves = FindLeaves(descriptors);
  std::vector<int32_t> words(descriptors.size());
  std::vector<std::pair<int32_t, int32_t>> placed(descriptors.size());  // (node, keypoint)
  for (size_t i = 0; i < descriptors.size(); ++i) {
    words[i] = leaves[i].word;
    placed[i] = {leaves[i].direct_node, static_cast<int32_t>(i)};
  }
  BagOfWords bag;
  bag.words = WeighWords(CountWords(std::move(words)), tree_.idf);
  std::sort(placed.begin(), placed.end());
  for (const auto& [node, keypoint] : placed) {
    if (bag.nodes.empty() || bag.nodes.back().first != node) bag.nodes.emplace_back(node, std::vector<int32_t>());
    bag.nodes.back().second.push_back(keypoint);
  }
  return bag;
}

}  // namespace tessera
