#include "wire/log_file.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "core/crc32.h"
#include "core/errors.h"
#include "core/files.h"

namespace tessera {
namespace {

constexpr uint64_t kSync = 0xEDA1DA01;
constexpr size_t kHeadBytes = 4 + 8 + 8 + 4 + 4;
constexpr size_t kFrontBytes = 256;  // hold the header of a message, whose publisher has at most 63 letters
constexpr uint64_t kMaxChannelLength = 255;
constexpr std::string_view kChecksumsTitle = "CRC-32 of each event of an LCM log, by Tessera\n";
constexpr auto kTitleBytes = static_cast<int64_t>(kChecksumsTitle.size());
constexpr int64_t kChecksumBytes = 4;

// 0 if there is none.
int64_t FileSize(const std::string& path) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  return error ? 0 : static_cast<int64_t>(size);
}

std::string ChecksumsPath(const std::string& log_path) { return log_path + ".checksums"; }

uint32_t ChecksumOf(ByteView head, const std::string& channel, ByteView data) {
  const ByteView name(reinterpret_cast<const uint8_t*>(channel.data()), channel.size());
  return Crc32(data, Crc32(name, Crc32(head)));
}

void PutBigEndian(uint64_t value, size_t size, uint8_t* bytes) {
  for (size_t i = 0; i < size; ++i) {
    bytes[i] = static_cast<uint8_t>(value >> (8 * (size - 1 - i)));
  }
}

uint64_t GetBigEndian(const uint8_t* bytes, size_t size) {
  uint64_t value = 0;
  for (size_t i = 0; i < size; ++i) {
    value = (value << 8) | bytes[i];
  }
  return value;
}

}  // namespace

LogFileReader::LogFileReader(const std::string& path) : path_(path) {
  if (!std::filesystem::is_regular_file(path)) {
    throw InputError("log " + path + " does not exist or is not a file: check the path");
  }
  file_.reset(std::fopen(path.c_str(), "rb"));
  if (!file_) {
    throw InputError("log " + path + " can't be opened (" + std::strerror(errno) + "): check its permissions");
  }
  size_ = static_cast<int64_t>(std::filesystem::file_size(path));
  std::array<uint8_t, 4> sync{};
  if (std::fread(sync.data(), 1, sync.size(), file_.get()) != sync.size() || GetBigEndian(sync.data(), 4) != kSync) {
    throw InputError("log " + path + " is not an LCM log: record one with `tessera record` or lcm-logger");
  }
  Seek(0);
  ReadChecksums();
}

void LogFileReader::ReadChecksums() {
  const std::string path = ChecksumsPath(path_);
  has_checksums_ = std::filesystem::exists(path);
  if (!has_checksums_) return;
  const std::string bytes = ReadFile(path);
  if (!bytes.starts_with(kChecksumsTitle) || (bytes.size() - kChecksumsTitle.size()) % 4 != 0) {
    throw InputError("file " + path + " is damaged: copy it again, or remove it to use the log without its checksums");
  }
  const auto* values = reinterpret_cast<const uint8_t*>(bytes.data()) + kChecksumsTitle.size();
  checksums_.resize((bytes.size() - kChecksumsTitle.size()) / 4);
  for (size_t i = 0; i < checksums_.size(); ++i) {
    checksums_[i] = static_cast<uint32_t>(GetBigEndian(values + 4 * i, 4));
  }
}

void LogFileReader::Check(int64_t number, uint32_t checksum, const std::string& channel) const {
  const auto i = static_cast<size_t>(number);
  if (number >= 0 && i < checksums_.size() && checksums_[i] == checksum) return;
  throw InputError("log " + path_ + " is damaged before byte " + std::to_string(position()) + ", in a message on " +
                   channel + ": it has not the checksum in " + ChecksumsPath(path_) +
                   "; copy or record it again, or remove that file to use the log as it is");
}

// Its time and lengths; nullopt at the end of the file.
std::optional<LogFileReader::Lengths> LogFileReader::ReadHead(LogEvent* event) {
  const size_t num_read = std::fread(head_.data(), 1, head_.size(), file_.get());
  if (num_read == 0) {
    // Cut between two events.
    if (has_checksums_ && last_number_ + 1 != num_checksums()) ThrowCut();
    return std::nullopt;
  }
  const Lengths lengths{GetBigEndian(head_.data() + 20, 4), GetBigEndian(head_.data() + 24, 4)};
  // Lengths are believed only as far as the file reaches.
  if (num_read < head_.size() || GetBigEndian(head_.data(), 4) != kSync || lengths.channel > kMaxChannelLength ||
      lengths.channel + lengths.data > static_cast<uint64_t>(size_ - position())) {
    ThrowCut();
  }
  last_number_ = static_cast<int64_t>(GetBigEndian(head_.data() + 4, 8));
  event->time_us = static_cast<int64_t>(GetBigEndian(head_.data() + 12, 8));
  event->channel.resize(lengths.channel);
  if (std::fread(event->channel.data(), 1, lengths.channel, file_.get()) != lengths.channel) ThrowCut();
  return lengths;
}

bool LogFileReader::Next(LogEvent* event) {
  const std::optional<Lengths> lengths = ReadHead(event);
  if (!lengths) return false;
  event->data.resize(lengths->data);
  if (std::fread(event->data.data(), 1, lengths->data, file_.get()) != lengths->data) ThrowCut();
  if (has_checksums_) Check(last_number_, ChecksumOf(head_, event->channel, event->data), event->channel);
  return true;
}

bool LogFileReader::NextFront(LogEvent* event) {
  const std::optional<Lengths> lengths = ReadHead(event);
  if (!lengths) return false;
  event->data.resize(std::min<uint64_t>(lengths->data, kFrontBytes));
  const auto rest = static_cast<long>(lengths->data - event->data.size());
  if (std::fread(event->data.data(), 1, event->data.size(), file_.get()) != event->data.size()) ThrowCut();
  if (rest > 0) std::fseek(file_.get(), rest, SEEK_CUR);
  return true;
}

int64_t LogFileReader::position() const { return std::ftell(file_.get()); }

void LogFileReader::Seek(int64_t position) { std::fseek(file_.get(), position, SEEK_SET); }

void LogFileReader::ThrowCut() const {
  throw InputError("log " + path_ + " is cut off or damaged before byte " + std::to_string(position()) + " of " +
                   std::to_string(size_) + ": record or copy it again");
}

LogFileWriter::LogFileWriter(const std::string& path, Checksums checksums) : path_(path), part_(path + ".part") {
  Open("wb", checksums);
  if (checksums_ != nullptr) WriteTo(checksums_, kChecksumsTitle.data(), kChecksumsTitle.size());
}

LogFileWriter::LogFileWriter(const std::string& path, const std::function<void(const LogEvent&)>& on_event)
    : path_(path), part_(path + ".part") {
  Open("r+b", Checksums::kBeside);
  CutChecksums((FileSize(ChecksumsPath(part_)) - kTitleBytes) / kChecksumBytes);
  try {
    LogFileReader reader(part_);
    for (LogEvent event; num_events_ < reader.num_checksums() && reader.NextFront(&event); ++num_events_) {
      num_bytes_ = reader.position();
      on_event(event);
    }
  } catch (const InputError&) {
    // From here on it is not whole.
  }
  CutChecksums(num_events_);
  if (ftruncate(fileno(file_), num_bytes_) != 0) ThrowUnwritable(part_);
  std::fseek(file_, 0, SEEK_END);
  std::fseek(checksums_, 0, SEEK_END);
}

LogFileWriter::~LogFileWriter() {
  if (file_ == nullptr) return;
  CloseFiles();
  Remove();
}

bool LogFileWriter::CanContinue(const std::string& path) {
  return FileSize(ChecksumsPath(path + ".part")) >= kTitleBytes;
}

void LogFileWriter::Open(const char* mode, Checksums checksums) {
  file_ = std::fopen(part_.c_str(), mode);
  if (file_ == nullptr) ThrowUnwritable(part_);
  if (checksums == Checksums::kNone) return;
  checksums_ = std::fopen(ChecksumsPath(part_).c_str(), mode);
  if (checksums_ != nullptr) {
    std::setbuf(checksums_, nullptr);
    return;
  }
  const int problem = errno;
  std::fclose(file_);
  errno = problem;
  ThrowUnwritable(ChecksumsPath(part_));
}

bool LogFileWriter::CloseFiles() {
  bool is_written = std::fclose(file_) == 0;
  if (checksums_ != nullptr) is_written = std::fclose(checksums_) == 0 && is_written;
  file_ = checksums_ = nullptr;
  return is_written;
}

void LogFileWriter::Remove() const {
  std::remove(part_.c_str());
  std::remove(ChecksumsPath(part_).c_str());
}

void LogFileWriter::CutChecksums(int64_t number) {
  if (ftruncate(fileno(checksums_), kTitleBytes + kChecksumBytes * number) != 0) ThrowUnwritable(part_);
}

void LogFileWriter::Abandon(int64_t room_bytes) {
  if (file_ == nullptr) return;
  CloseFiles();
  const int64_t size = FileSize(part_);
  if (size <= room_bytes) return Remove();
  std::remove(ChecksumsPath(part_).c_str());
  std::error_code ignored;
  std::filesystem::resize_file(part_, static_cast<uintmax_t>(size - room_bytes), ignored);
}

void LogFileWriter::WriteTo(std::FILE* file, const void* bytes, size_t size) const {
  if (size > 0 && std::fwrite(bytes, 1, size, file) != size) ThrowUnwritable(part_);  // bytes of none may be null
}

void LogFileWriter::Write(int64_t time_us, const std::string& channel, ByteView data) {
  std::array<uint8_t, kHeadBytes> head{};
  PutBigEndian(kSync, 4, head.data());
  PutBigEndian(static_cast<uint64_t>(num_events_), 8, head.data() + 4);
  PutBigEndian(static_cast<uint64_t>(time_us), 8, head.data() + 12);
  PutBigEndian(channel.size(), 4, head.data() + 20);
  PutBigEndian(data.size(), 4, head.data() + 24);
  WriteTo(file_, head.data(), head.size());
  WriteTo(file_, channel.data(), channel.size());
  WriteTo(file_, data.data(), data.size());
  if (checksums_ != nullptr) {
    // Behind the event: one that has its checksum is whole.
    if (std::fflush(file_) != 0) ThrowUnwritable(part_);
    std::array<uint8_t, kChecksumBytes> checksum{};
    PutBigEndian(ChecksumOf(head, channel, data), checksum.size(), checksum.data());
    WriteTo(checksums_, checksum.data(), checksum.size());
  }
  ++num_events_;
  num_bytes_ += static_cast<int64_t>(head.size() + channel.size() + data.size());
}

void LogFileWriter::Close() {
  if (file_ == nullptr) return;
  const bool has_checksums = checksums_ != nullptr;
  // On the disk before it takes its name: a machine that loses power keeps the file that was there.
  const bool is_on_disk = std::fflush(file_) == 0 && fsync(fileno(file_)) == 0;
  const bool is_written = CloseFiles() && is_on_disk;
  std::remove(ChecksumsPath(path_).c_str());  // those of an earlier log
  if (is_written && std::rename(part_.c_str(), path_.c_str()) == 0 &&
      (!has_checksums || std::rename(ChecksumsPath(part_).c_str(), ChecksumsPath(path_).c_str()) == 0)) {
    return;
  }
  const int problem = errno;
  Remove();
  errno = problem;
  ThrowUnwritable(path_);
}

void LogFileWriter::ThrowUnwritable(const std::string& path) const {
  throw InputError("log " + path + " can't be written (" + std::strerror(errno) +
                   "): check the folder, its permissions and the room on the disk");
}

}  // namespace tessera
