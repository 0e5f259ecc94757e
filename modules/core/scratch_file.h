// Bytes that memory has no room for, in a file without a name: it vanishes with its process.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tessera {

class ScratchFile {
 public:
  // The file lies in `folder`, which is made if it is not there. Nothing happens before the first Put().
  explicit ScratchFile(std::string folder) : folder_(std::move(folder)) {}
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  // A piece of the file.
  struct Place {
    int64_t offset = 0;
    int64_t capacity = 0;  // bytes
    int64_t size = 0;      // of them in use
  };
  // nullopt if the file can't be made or the disk has no room.
  std::optional<Place> Put(std::string_view bytes);
  // The bytes, whose place is free from now on. nullopt if they can't be read.
  std::optional<std::string> Take(const Place& place);
  void Drop(const Place& place) { free_.push_back(place); }

 private:
  bool Open();
  Place FindRoom(int64_t size);

  const std::string folder_;
  int file_ = -1;
  int64_t end_ = 0;
  std::vector<Place> free_;
};

}  // namespace tessera
