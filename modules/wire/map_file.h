// A map on disk: an LCM log that holds one MAP_FILE message and then the pages of a snapshot as MAP_SNAPSHOT messages,
// so that stock LCM tools can read it.
#pragma once

#include <cstdint>
#include <string>

#include "geometry/camera.h"
#include "map/map.h"

namespace tessera {

// What stands before the pages.
struct MapFileHeader {
  int32_t version = 0;  // of the whole file's format
  int32_t num_pages = 0;
  int64_t num_keyframes = 0;
  int64_t num_landmarks = 0;
  CameraCalibration camera;  // that the map was made with
};

// Writes beside, then renames. Throws InputError if it can't be written.
void WriteMapFile(const Map& map, const std::string& path);

// The snapshot in the file. Throws InputError with one sentence: no such file, no map file, of another version, cut
// off, damaged. Whether its content is what was written, Map::Apply tells by the hash.
MapDelta ReadMapFile(const std::string& path);

}  // namespace tessera
