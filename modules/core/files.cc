#include "core/files.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>

#include "core/errors.h"

namespace tessera {

std::string ReadFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file || std::filesystem::is_directory(path)) {
    throw InputError("file " + path + " can't be read: check that it exists and may be read");
  }
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  std::string bytes(error ? 0 : static_cast<size_t>(size), '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<size_t>(file.gcount()));
  // What the kernel makes as it is read, and pipes, don't tell their size.
  if (file) bytes.append(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  return bytes;
}

void WriteFile(const std::string& path, std::string_view bytes) {
  const std::string unfinished = path + ".unfinished";
  std::ofstream file(unfinished, std::ios::binary | std::ios::trunc);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(unfinished, path, error);
  if (!file || error) {
    std::filesystem::remove(unfinished, error);
    throw InputError("file " + path + " can't be written: check the folder, its permissions and the space on the disk");
  }
}

}  // namespace tessera
