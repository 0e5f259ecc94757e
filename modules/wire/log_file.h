// LCM log files, event by event. A log is a row of events, numbers most significant byte first:
//   0xEDA1DA01 (4 bytes), number (8), time in us (8), length of the channel (4), of the data (4), channel, data.
// Read and written here rather than by LCM, whose reader believes the lengths and can't tell a damaged log from its
// end.
//
// A log of ours has a file beside it, LOG.checksums: a line that says so, then the CRC-32 of each event, 4 bytes each.
// Both grow event by event, so that a writer that is killed leaves whole events, behind which its successor continues.
#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "wire/bytes.h"

namespace tessera {

struct LogEvent {
  int64_t time_us = 0;
  std::string channel;
  Bytes data;
};

class LogFileReader {
 public:
  // Throws InputError if there is no such file, it is not an LCM log, or what is beside it has no checksums.
  explicit LogFileReader(const std::string& path);

  // False at the end of the file. Throws InputError if an event is damaged or cut off, or has not its checksum.
  bool Next(LogEvent* event);
  // The same with no more of the data than holds the header of a message; its checksum is not looked at.
  bool NextFront(LogEvent* event);
  int64_t num_checksums() const { return static_cast<int64_t>(checksums_.size()); }
  // Where the next event begins, bytes from the front; and going there.
  int64_t position() const;
  void Seek(int64_t position);

 private:
  struct CloseFile {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  struct Lengths {
    uint64_t channel = 0, data = 0;
  };
  [[noreturn]] void ThrowCut() const;
  void ReadChecksums();
  std::optional<Lengths> ReadHead(LogEvent* event);
  void Check(int64_t number, uint32_t checksum, const std::string& channel) const;

  std::string path_;
  std::unique_ptr<std::FILE, CloseFile> file_;
  int64_t size_ = 0;
  bool has_checksums_ = false;
  std::vector<uint32_t> checksums_;  // by number of the event
  std::array<uint8_t, 28> head_{};   // of the event that was read last
  int64_t last_number_ = -1;         // of the event that was read last
};

enum class Checksums { kNone, kBeside };

class LogFileWriter {
 public:
  // Writes into PATH.part, which takes the name PATH when it is closed: no log is ever half written. Throws InputError
  // if it can't be written.
  explicit LogFileWriter(const std::string& path, Checksums checksums = Checksums::kNone);
  // Continues PATH.part, which a writer with checksums left when it was killed, behind its last whole event. `on_event`
  // gets the front (NextFront) of each that is there.
  LogFileWriter(const std::string& path, const std::function<void(const LogEvent&)>& on_event);
  // Whether there is something to continue. False if it was given up.
  static bool CanContinue(const std::string& path);
  ~LogFileWriter();  // without Close(): nothing is kept
  LogFileWriter(const LogFileWriter&) = delete;
  LogFileWriter& operator=(const LogFileWriter&) = delete;

  // Throws InputError if the disk is full.
  void Write(int64_t time_us, const std::string& channel, ByteView data);
  void Close();
  // After a failure: what is written stays as PATH.part, except its last `room_bytes`, which are given back to the
  // disk. Nothing is written from then on.
  void Abandon(int64_t room_bytes);

  int64_t num_events() const { return num_events_; }
  int64_t num_bytes() const { return num_bytes_; }

 private:
  [[noreturn]] void ThrowUnwritable(const std::string& path) const;
  void Open(const char* mode, Checksums checksums);
  bool CloseFiles();
  void Remove() const;
  void WriteTo(std::FILE* file, const void* bytes, size_t size) const;
  void CutChecksums(int64_t number);

  const std::string path_, part_;  // the name at the end, and until then
  std::FILE* file_ = nullptr;
  std::FILE* checksums_ = nullptr;  // null: there are none
  int64_t num_events_ = 0;
  int64_t num_bytes_ = 0;
};

}  // namespace tessera
