#include "simulation/paint_store.h"

#include <algorithm>
#include <utility>

namespace tessera {
namespace {

constexpr size_t kMaxPaintBytes = size_t{600} << 20;

}  // namespace

PaintStore::PaintStore(std::shared_ptr<const World> world)
    : world_(std::move(world)), entries_(world_->paints.size()) {}

const Texture& PaintStore::Get(int32_t paint) {
  std::unique_ptr<Entry>& entry = entries_[static_cast<size_t>(paint)];
  if (!entry) {
    MakeRoom();
    entry = std::make_unique<Entry>();
    entry->texture = Paint(world_->paints[static_cast<size_t>(paint)], world_->streets.get());
    for (const GrayImage& level : entry->texture.levels) entry->num_bytes += level.pixels.size();
    for (const GrayImage& level : entry->texture.cover) entry->num_bytes += level.pixels.size();
    num_bytes_ += entry->num_bytes;
  }
  entry->last_use = ++num_uses_;
  return entry->texture;
}

// Forgets the half that was not used for the longest time.
void PaintStore::MakeRoom() {
  if (num_bytes_ < kMaxPaintBytes) return;
  std::vector<uint64_t> uses;
  for (const auto& entry : entries_) {
    if (entry) uses.push_back(entry->last_use);
  }
  const auto median = uses.begin() + static_cast<ptrdiff_t>(uses.size() / 2);
  std::nth_element(uses.begin(), median, uses.end());
  for (auto& entry : entries_) {
    if (entry && entry->last_use < *median) {
      num_bytes_ -= entry->num_bytes;
      entry.reset();
    }
  }
}

}  // namespace tessera
