#include "runtime/journal.h"

#include <fcntl.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <utility>

#include "core/crc32.h"
#include "core/errors.h"

namespace tessera {
namespace {

// The first entry stands in place of a channel's message.
constexpr std::string_view kTitle = "tessera journal 1";
constexpr std::string_view kLostTitle = "tessera journal 1, given up";

// In front of an entry; in the byte order of the machine, which alone reads it.
struct Head {
  uint32_t num_bytes = 0;  // of what follows
  uint32_t checksum = 0;   // of it
  // What follows: arrival time, length of the channel's name (1 byte), the name, the message.
};
constexpr size_t kMinBytes = sizeof(int64_t) + 1;

size_t EntryBytes(const std::string& channel, ByteView message) {
  return sizeof(Head) + kMinBytes + channel.size() + message.size();
}

// All of an entry but the message.
Bytes EncodeFront(const std::string& channel, ByteView message, int64_t arrival_us) {
  Bytes front(sizeof(Head) + kMinBytes + channel.size());
  uint8_t* at = front.data() + sizeof(Head);
  std::memcpy(at, &arrival_us, sizeof(arrival_us));
  at[sizeof(arrival_us)] = static_cast<uint8_t>(channel.size());
  std::copy(channel.begin(), channel.end(), at + kMinBytes);
  const ByteView content = ByteView(front).subspan(sizeof(Head));
  const Head head{static_cast<uint32_t>(content.size() + message.size()), Crc32(message, Crc32(content))};
  std::memcpy(front.data(), &head, sizeof(head));
  return front;
}

std::optional<Journal::Entry> Decode(ByteView content) {
  if (content.size() < kMinBytes || content.size() < kMinBytes + content[kMinBytes - 1]) return std::nullopt;
  Journal::Entry entry;
  std::memcpy(&entry.arrival_us, content.data(), sizeof(entry.arrival_us));
  const ByteView name = content.subspan(kMinBytes, content[kMinBytes - 1]);
  const ByteView message = content.subspan(kMinBytes + name.size());
  entry.channel.assign(name.begin(), name.end());
  entry.message.assign(message.begin(), message.end());
  return entry;
}

// In one call, so that an entry is there as a whole or is the last one; the message is written from where it lies.
bool WriteEntry(int file, const std::string& channel, ByteView message, int64_t arrival_us) {
  Bytes front = EncodeFront(channel, message, arrival_us);
  const std::array<iovec, 2> pieces = {
      iovec{front.data(), front.size()},
      iovec{const_cast<uint8_t*>(message.data()), message.size()}};  // writev only reads it
  return writev(file, pieces.data(), static_cast<int>(pieces.size())) ==
         static_cast<ssize_t>(front.size() + message.size());
}

// What others have to write is small and precious: trajectories, the summary. Journals leave it this much of the disk.
constexpr uintmax_t kMaxReserveBytes = 64'000'000, kReserveShare = 32;

bool IsNearlyFull(const std::string& path) {
  std::error_code unknown;
  const std::filesystem::space_info disk = std::filesystem::space(path, unknown);
  return !unknown && disk.available < std::min(kMaxReserveBytes, disk.capacity / kReserveShare);
}

[[noreturn]] void ThrowUnusable(const std::string& path) {
  throw InputError("the journal " + path + " can't be used (" + std::strerror(errno) +
                   "): check the folder and the room on the disk, or do without by stream.journal_dir=\"\": a killed "
                   "tracker ends the run then");
}

}  // namespace

Journal::Journal(std::string path, int64_t epoch_us, int64_t max_bytes)
    : path_(std::move(path)), max_bytes_(max_bytes), epoch_us_(epoch_us) {
  std::error_code ignored;
  std::filesystem::create_directories(std::filesystem::path(path_).parent_path(), ignored);
  reader_.reset(std::fopen(path_.c_str(), "rbe"));
  if (!reader_) {
    is_lost_ = errno == EIO;
    if (is_lost_) return;
    if (errno != ENOENT) ThrowUnusable(path_);
    Begin(epoch_us);
  }
  file_ = open(path_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  if (file_ < 0 && reader_) {
    is_lost_ = true;
    reader_.reset();
    return;
  }
  if (file_ < 0) ThrowUnusable(path_);
  if (!reader_) return;
  std::fseek(reader_.get(), 0, SEEK_END);
  size_ = std::ftell(reader_.get());
  std::rewind(reader_.get());
  const std::optional<Entry> title = Read();
  is_lost_ = !title || title->channel != kTitle;
  if (is_lost_) reader_.reset();
  if (!is_lost_) epoch_us_ = title->arrival_us;
}

Journal::~Journal() {
  if (file_ >= 0) close(file_);
}

// Beside, then renamed: a journal without its title is one that was given up.
void Journal::Begin(int64_t epoch_us) {
  const std::string part = path_ + ".part";
  const int file = open(part.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (file < 0) ThrowUnusable(part);
  const bool is_written = WriteEntry(file, std::string(kTitle), {}, epoch_us);
  close(file);
  if (!is_written || std::rename(part.c_str(), path_.c_str()) != 0) ThrowUnusable(path_);
  num_bytes_ = static_cast<int64_t>(EntryBytes(std::string(kTitle), {}));
}

// nullopt at the end, or where an entry is not whole.
std::optional<Journal::Entry> Journal::Read() {
  if (is_at_end_) return std::nullopt;
  is_at_end_ = true;  // until an entry is whole
  Head head;
  if (std::fread(&head, sizeof(head), 1, reader_.get()) != 1) return std::nullopt;
  if (head.num_bytes > size_ - std::ftell(reader_.get())) return std::nullopt;
  Bytes content(head.num_bytes);
  if (std::fread(content.data(), 1, content.size(), reader_.get()) != content.size() ||
      Crc32(content) != head.checksum) {
    return std::nullopt;
  }
  std::optional<Entry> entry = Decode(content);
  is_at_end_ = !entry;
  if (entry) num_bytes_ += static_cast<int64_t>(sizeof(head) + content.size());
  return entry;
}

double Journal::replayed_share() const {
  return is_replaying() ? static_cast<double>(num_bytes_) / static_cast<double>(size_) : 1.0;
}

std::optional<Journal::Entry> Journal::Next() {
  if (!reader_) return std::nullopt;
  std::optional<Entry> entry = ahead_ ? std::exchange(ahead_, std::nullopt) : Read();
  if (entry) return entry;
  reader_.reset();
  if (ftruncate(file_, num_bytes_) != 0) ThrowUnusable(path_);
  return std::nullopt;
}

std::optional<Journal::Entry> Journal::NextOf(const std::string& channel) {
  if (!reader_) return std::nullopt;
  if (!ahead_) ahead_ = Read();
  if (!ahead_ || ahead_->channel != channel) return std::nullopt;
  return std::exchange(ahead_, std::nullopt);
}

Result<> Journal::Append(const std::string& channel, ByteView message, int64_t arrival_us) {
  if (is_lost_) return {};
  num_bytes_ += static_cast<int64_t>(EntryBytes(channel, message));
  if (num_bytes_ > max_bytes_) return GiveUp("it would be larger than stream.journal_mb");
  if (!WriteEntry(file_, channel, message, arrival_us)) return GiveUp(std::strerror(errno));
  if (IsNearlyFull(path_)) return GiveUp("the disk is nearly full");
  return {};
}

// Its room is given back: others may need it more.
Result<> Journal::GiveUp(const std::string& why) {
  is_lost_ = true;
  // An empty file says the same as this title.
  if (ftruncate(file_, 0) == 0) WriteEntry(file_, std::string(kLostTitle), {}, epoch_us_);
  return Failed("the journal " + path_ + " is given up (" + why +
                "): this process may not come back if it is killed from now on");
}

}  // namespace tessera
