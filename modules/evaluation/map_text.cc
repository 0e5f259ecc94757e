#include "evaluation/map_text.h"

#include <cstdio>

namespace tessera {

std::string PlyText(const Map& map, const Rigid3& world_from_map) {
  std::string text = "ply\nformat ascii 1.0\ncomment landmarks of Tessera\nelement vertex " +
                     std::to_string(map.landmarks().size()) + "\n";
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) text += std::string("property float ") + name + "\n";
  text += "property int observations\nend_header\n";
  map.landmarks().ForEach([&](LandmarkId id, const Landmark& landmark) {
    const Eigen::Vector3d p = world_from_map * landmark.position_in_world;
    const Eigen::Vector3d n = world_from_map.rotation * landmark.normal;
    char row[200];
    std::snprintf(row, sizeof row, "%.6g %.6g %.6g %.4f %.4f %.4f %zu\n", p.x(), p.y(), p.z(), n.x(), n.y(), n.z(),
                  map.ObservationsOf(id).size());
    text += row;
  });
  return text;
}

}  // namespace tessera
