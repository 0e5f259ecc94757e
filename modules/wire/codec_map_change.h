// The lists of a change of the map to messages and back, part by part.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "map/map.h"
#include "tessera/map_change_t.hpp"

namespace tessera {

// Cuts the lists of a delta, one after the other, into messages.
class ChangeCutter {
 public:
  explicit ChangeCutter(const MapDelta& delta);
  ~ChangeCutter();

  // Moves as much into *change as fits into so many bytes, and one item at least.
  void Fill(size_t room, map_change_t* change);
  bool done() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// Appends what came to the delta's lists. Empty, or what is wrong with it. A keyframe that a message leaves unfinished
// goes on in the next one, first of all; `is_last`: there is none.
std::string JoinChange(const map_change_t& change, bool is_last, MapDelta* delta);

}  // namespace tessera
