// Whole files, read and written at once.
#pragma once

#include <string>
#include <string_view>

namespace tessera {

// All bytes of a file. Throws InputError if it can't be read.
std::string ReadFile(const std::string& path);

// Writes beside `path`, then renames: a reader sees the old file or the new one, never half of one. Throws InputError
// if it can't be written.
void WriteFile(const std::string& path, std::string_view bytes);

}  // namespace tessera
