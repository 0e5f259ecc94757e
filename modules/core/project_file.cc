#include "core/project_file.h"

namespace tessera {

std::optional<std::filesystem::path> FindProjectFile(const std::string& relative) {
  const std::filesystem::path program = std::filesystem::canonical("/proc/self/exe");
  for (std::filesystem::path folder = program; folder != folder.root_path();) {
    folder = folder.parent_path();
    if (std::filesystem::is_regular_file(folder / relative)) return folder / relative;
  }
  return std::nullopt;
}

}  // namespace tessera
