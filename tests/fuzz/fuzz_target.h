// What every fuzz target shares: how its input is cut, files in memory, and what it may end with.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace tessera {

// Defined by each target: valid inputs, from which the fuzzer begins; and what reads any input. Whatever it throws but
// InputError, and every report of a sanitizer, is an error.
std::vector<std::string> Seeds();
void Read(std::string_view input);

// Takes numbers and pieces off the front of an input; behind its end there are zeros and empty pieces.
class FuzzInput {
 public:
  explicit FuzzInput(std::string_view rest) : rest_(rest) {}

  bool is_empty() const { return rest_.empty(); }
  uint8_t TakeByte();
  // Its length comes first, in two bytes; the last piece may be shorter.
  std::string_view TakePiece();
  std::string_view TakeRest();

 private:
  std::string_view Take(size_t size);
  std::string_view rest_;
};

// What FuzzInput takes as one piece.
std::string Piece(std::string_view text);

// The inputs of a file of pieces; none if there is no such file.
std::vector<std::string> ReadCorpus(const std::string& path);

// A folder for the input's files, in memory, removed at the end.
class FuzzFolder {
 public:
  FuzzFolder();
  ~FuzzFolder();
  FuzzFolder(const FuzzFolder&) = delete;
  FuzzFolder& operator=(const FuzzFolder&) = delete;

  std::string path(const std::string& name) const { return path_ + "/" + name; }
  // Folders on the way are made.
  void Write(const std::string& name, std::string_view text) const;

 private:
  std::string path_;
};

// Calls `read`, which may throw InputError with one sentence; another exception ends the program.
void ExpectSentence(const std::function<void()>& read);

// Ends the program unless `condition` holds.
void Expect(bool condition, const char* what);

}  // namespace tessera
