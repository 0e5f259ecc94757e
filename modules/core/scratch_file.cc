#include "core/scratch_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>

namespace tessera {
namespace {

// Moves all bytes by `move(at, how many, offset)`, as pread and pwrite do; false if one fails.
template <class Move>
bool MoveAll(int64_t size, int64_t offset, Move move) {
  for (int64_t done = 0; done < size;) {
    const ssize_t moved = move(done, static_cast<size_t>(size - done), offset + done);
    if (moved < 0 && errno == EINTR) continue;
    if (moved <= 0) return false;
    done += moved;
  }
  return true;
}

}  // namespace

ScratchFile::~ScratchFile() {
  if (file_ >= 0) close(file_);
}

bool ScratchFile::Open() {
  if (file_ >= 0) return true;
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  std::string name = folder_ + "/scratch.XXXXXX";
  file_ = mkostemp(name.data(), O_CLOEXEC);
  if (file_ >= 0) unlink(name.c_str());
  return file_ >= 0;
}

// The first free piece that is large enough, else one at the end.
ScratchFile::Place ScratchFile::FindRoom(int64_t size) {
  const auto fits = std::ranges::find_if(free_, [size](const Place& place) { return place.capacity >= size; });
  if (fits == free_.end()) {
    end_ += size;
    return {end_ - size, size, size};
  }
  const Place place{fits->offset, fits->capacity, size};
  free_.erase(fits);
  return place;
}

std::optional<ScratchFile::Place> ScratchFile::Put(std::string_view bytes) {
  if (!Open()) return std::nullopt;
  const Place place = FindRoom(static_cast<int64_t>(bytes.size()));
  const bool is_written = MoveAll(place.size, place.offset, [&](int64_t at, size_t count, int64_t offset) {
    return pwrite(file_, bytes.data() + at, count, offset);
  });
  if (is_written) return place;
  Drop(place);
  return std::nullopt;
}

std::optional<std::string> ScratchFile::Take(const Place& place) {
  std::string bytes(static_cast<size_t>(place.size), '\0');
  const bool is_read = MoveAll(place.size, place.offset, [&](int64_t at, size_t count, int64_t offset) {
    return pread(file_, bytes.data() + at, count, offset);
  });
  Drop(place);
  return is_read ? std::optional(std::move(bytes)) : std::nullopt;
}

}  // namespace tessera
