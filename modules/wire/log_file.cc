#include "wire/log_file.h"

#include <unistd.h>

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
constexpr size_t kHeaderBytes = 4 + 8 + 8 + 4 + 4;
constexpr uint64_t kMaxChannelLength = 255;
constexpr std::string_view kChecksumsTitle = "CRC-32 of each event of an LCM log, by Tessera\n";

std::string ChecksumsPath(const std::string& log_path) { return log_path + ".checksums"; }

uint32_t ChecksumOf(ByteView header, const std::string& channel, ByteView data) {
  const ByteView name(reinterpret_cast<const uint8_t*>(channel.data()), channel.size());
  return Crc32(data, Crc32(name, Crc32(header)));
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

bool LogFileReader::Next(LogEvent* event) {
  std::array<uint8_t, kHeaderBytes> header{};
  const size_t num_read = std::fread(header.data(), 1, header.size(), file_.get());
  if (num_read == 0) {
    // Cut between two events.
    if (has_checksums_ && last_number_ + 1 != static_cast<int64_t>(checksums_.size())) ThrowCut();
    return false;
  }
  const uint64_t channel_length = GetBigEndian(header.data() + 20, 4);
  const uint64_t data_length = GetBigEndian(header.data() + 24, 4);
  // Lengths are believed only as far as the file reaches.
  if (num_read < header.size() || GetBigEndian(header.data(), 4) != kSync || channel_length > kMaxChannelLength ||
      channel_length + data_length > static_cast<uint64_t>(size_ - position())) {
    ThrowCut();
  }
  event->time_us = static_cast<int64_t>(GetBigEndian(header.data() + 12, 8));
  event->channel.resize(channel_length);
  event->data.resize(data_length);
  if (std::fread(event->channel.data(), 1, channel_length, file_.get()) != channel_length ||
      std::fread(event->data.data(), 1, data_length, file_.get()) != data_length) {
    ThrowCut();
  }
  last_number_ = static_cast<int64_t>(GetBigEndian(header.data() + 4, 8));
  if (has_checksums_) Check(last_number_, ChecksumOf(header, event->channel, event->data), event->channel);
  return true;
}

int64_t LogFileReader::position() const { return std::ftell(file_.get()); }

void LogFileReader::Seek(int64_t position) { std::fseek(file_.get(), position, SEEK_SET); }

void LogFileReader::ThrowCut() const {
  throw InputError("log " + path_ + " is cut off or damaged before byte " + std::to_string(position()) + " of " +
                   std::to_string(size_) + ": record or copy it again");
}

LogFileWriter::LogFileWriter(const std::string& path, Checksums checksums)
    : path_(path), file_(std::fopen((path + ".part").c_str(), "wb")), mode_(checksums) {
  if (file_ == nullptr) {
    ThrowUnwritable(path + ".part");
  }
}

LogFileWriter::~LogFileWriter() {
  if (file_ == nullptr) return;
  std::fclose(file_);
  std::remove((path_ + ".part").c_str());
}

void LogFileWriter::Abandon(int64_t room_bytes) {
  if (file_ == nullptr) return;
  std::fclose(file_);
  file_ = nullptr;
  const std::string part = path_ + ".part";
  std::error_code error;
  const auto size = static_cast<int64_t>(std::filesystem::file_size(part, error));
  if (error) return;
  if (size > room_bytes) {
    std::filesystem::resize_file(part, static_cast<uintmax_t>(size - room_bytes), error);
  } else {
    std::filesystem::remove(part, error);
  }
}

void LogFileWriter::Write(int64_t time_us, const std::string& channel, ByteView data) {
  std::array<uint8_t, kHeaderBytes> header{};
  PutBigEndian(kSync, 4, header.data());
  PutBigEndian(static_cast<uint64_t>(num_events_), 8, header.data() + 4);
  PutBigEndian(static_cast<uint64_t>(time_us), 8, header.data() + 12);
  PutBigEndian(channel.size(), 4, header.data() + 20);
  PutBigEndian(data.size(), 4, header.data() + 24);
  if (std::fwrite(header.data(), 1, header.size(), file_) != header.size() ||
      std::fwrite(channel.data(), 1, channel.size(), file_) != channel.size() ||
      std::fwrite(data.data(), 1, data.size(), file_) != data.size()) {
    ThrowUnwritable(path_ + ".part");
  }
  if (mode_ == Checksums::kBeside) checksums_.push_back(ChecksumOf(header, channel, data));
  ++num_events_;
  num_bytes_ += static_cast<int64_t>(header.size() + channel.size() + data.size());
}

void LogFileWriter::Close() {
  if (file_ == nullptr) return;
  // On the disk before it takes its name: a machine that loses power keeps the file that was there.
  const bool is_on_disk = std::fflush(file_) == 0 && fsync(fileno(file_)) == 0;
  const bool is_written = std::fclose(file_) == 0 && is_on_disk;
  file_ = nullptr;
  std::remove(ChecksumsPath(path_).c_str());  // those of an earlier log
  if (is_written && std::rename((path_ + ".part").c_str(), path_.c_str()) == 0) {
    if (mode_ == Checksums::kBeside) WriteChecksums();
    return;
  }
  const int problem = errno;
  std::remove((path_ + ".part").c_str());
  errno = problem;
  ThrowUnwritable(path_);
}

void LogFileWriter::WriteChecksums() const {
  std::string bytes(kChecksumsTitle);
  for (const uint32_t checksum : checksums_) {
    std::array<uint8_t, 4> value{};
    PutBigEndian(checksum, value.size(), value.data());
    bytes.append(value.begin(), value.end());
  }
  WriteFile(ChecksumsPath(path_), bytes);
}

void LogFileWriter::ThrowUnwritable(const std::string& path) const {
  throw InputError("log " + path + " can't be written (" + std::strerror(errno) +
                   "): check the folder, its permissions and the room on the disk");
}

}  // namespace tessera
