#include "evaluation/map_ply.h"

#include <bit>
#include <cstdint>

namespace tessera {
namespace {

constexpr Rgb kUnknown{128, 128, 128};

void Append(uint32_t bits, std::string* file) {
  for (int shift = 0; shift < 32; shift += 8) file->push_back(static_cast<char>(bits >> shift & 0xff));
}

void Append(const Eigen::Vector3d& vector, std::string* file) {
  for (int i = 0; i < 3; ++i) Append(std::bit_cast<uint32_t>(static_cast<float>(vector[i])), file);
}

}  // namespace

std::string PlyFile(const Map& map, const LandmarkColors& colors, const Rigid3& world_from_map) {
  std::string file = "ply\nformat binary_little_endian 1.0\ncomment landmarks of Tessera\nelement vertex " +
                     std::to_string(map.landmarks().size()) + "\n";
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) file += std::string("property float ") + name + "\n";
  file += "property int observations\n";
  if (!colors.empty()) file += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  file += "end_header\n";
  map.landmarks().ForEach([&](LandmarkId id, const ObservedLandmark& landmark) {
    Append(world_from_map * landmark.position_in_world, &file);
    Append(world_from_map.rotation * landmark.normal, &file);
    Append(static_cast<uint32_t>(map.ObservationsOf(id).size()), &file);
    if (colors.empty()) return;
    const Rgb color = colors.Of(landmark).value_or(kUnknown);
    for (const uint8_t share : {color.red, color.green, color.blue}) file.push_back(static_cast<char>(share));
  });
  return file;
}

}  // namespace tessera
