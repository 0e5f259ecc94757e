// What a stage received, and what it wants to remember of long steps, in a file: the memory that outlives its process.
// A stage that is killed and started again is given all of it once more, in the same order. As what it says is a pure
// function of that, it comes to the state that it had, and makes the same messages with the same numbers in the same
// streams: nobody else notices more than a pause.
//
// The file is a row of entries, each with its length and its CRC-32 in front. It is cut off where the first one is not
// whole: nobody has seen what would have followed from that.
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>

#include "core/result.h"
#include "wire/bytes.h"

namespace tessera {

class Journal {
 public:
  struct Entry {
    std::string channel;  // without prefix
    int64_t arrival_us = 0;
    Bytes message;
  };

  // Continues the journal PATH, or begins it: a life that starts at `epoch_us` then. The folder is made if it is not
  // there. A journal that would be larger than `max_bytes`, or that fills the disk but for a rest that is left to
  // the results, is given up; so is one whose disk has broken since it was begun. Throws InputError if the file can't
  // be begun.
  Journal(std::string path, int64_t epoch_us, int64_t max_bytes);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  // When the first life began of those that it holds.
  int64_t epoch_us() const { return epoch_us_; }
  // An earlier life had to give it up, or its disk is broken: it holds nothing, and takes nothing.
  bool is_lost() const { return is_lost_; }

  // There are entries of an earlier life that Next() has not given yet, or it was not asked.
  bool is_replaying() const { return reader_ != nullptr; }
  // How much of the file, 0 to 1, Next() has given; 1 where there is nothing to give.
  double replayed_share() const;
  // The next of them; nullopt: that was the last one.
  std::optional<Entry> Next();
  // The next of them if it has this name.
  std::optional<Entry> NextOf(const std::string& channel);

  // Behind the last one. Fails once, if it is given up for this.
  Result<> Append(const std::string& channel, ByteView message, int64_t arrival_us);

 private:
  struct CloseFile {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  void Begin(int64_t epoch_us);
  std::optional<Entry> Read();
  Result<> GiveUp(const std::string& why);

  const std::string path_;
  const int64_t max_bytes_;
  int64_t epoch_us_ = 0;
  bool is_lost_ = false;
  std::unique_ptr<std::FILE, CloseFile> reader_;
  bool is_at_end_ = false;      // of what is whole in it
  std::optional<Entry> ahead_;  // was read, and not given yet
  int64_t size_ = 0;            // of the file when it was opened for reading
  int64_t num_bytes_ = 0;       // of whole entries, as far as they are read or written
  int file_ = -1;               // that is written
};

}  // namespace tessera
