// The paints of a world: made when first seen, and kept while lately used.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "simulation/texture.h"
#include "simulation/world.h"

namespace tessera {

class PaintStore {
 public:
  explicit PaintStore(std::shared_ptr<const World> world);
  const Texture& Get(int32_t paint);

 private:
  struct Entry {
    Texture texture;
    size_t num_bytes = 0;
    uint64_t last_use = 0;
  };
  void MakeRoom();

  std::shared_ptr<const World> world_;
  std::vector<std::unique_ptr<Entry>> entries_;  // by paint
  size_t num_bytes_ = 0;
  uint64_t num_uses_ = 0;
};

}  // namespace tessera
