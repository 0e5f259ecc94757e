// Where the files that come with Tessera are: the settings, the vocabulary.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace tessera {

// The file `relative`, such as "config/default.yaml", of the checkout or installed folder that this program is in: from
// the nearest folder above the program that has it, so that the whole can be moved. nullopt if none has.
std::optional<std::filesystem::path> FindProjectFile(const std::string& relative);

}  // namespace tessera
