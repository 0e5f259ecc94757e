// A map on disk: an LCM log that holds one MAP_FILE message and then the pages of a snapshot as MAP_SNAPSHOT messages, so
// that stock LCM tools can read it.
#pragma once

#include <string>

#include "map/map.h"

namespace tessera {

// Writes beside, then renames. Throws InputError if it can't be written.
void WriteMapFile(const Map& map, const std::string& path);

// The snapshot in the file, tried on a map of its own. Throws InputError with one sentence: no such file, no map file, of
// another version, cut off, damaged.
MapDelta ReadMapFile(const std::string& path);

}  // namespace tessera
