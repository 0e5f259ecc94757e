// Notices when a live source falls silent, comes back, or is given up. The time is told.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace tessera {

class SourceWatch {
 public:
  // `give_up_us`: a source that is silent for so long is not waited for any longer; 0: it is waited for without end.
  explicit SourceWatch(int64_t give_up_us) : give_up_us_(give_up_us) {}

  // A frame came. A sentence if the source was silent before it.
  std::optional<std::string> NoteFrame(int64_t now_us);
  // To be called a few times a second. A sentence when the source has fallen silent, or is given up.
  std::optional<std::string> Look(int64_t now_us);

  // Since the last frame, or since the first look; 0 for as long as that is ordinary.
  int64_t SilenceUs(int64_t now_us) const;
  bool has_given_up() const { return has_given_up_; }

  // The slowest camera sends an image a second; the first may take a while, since it has to be opened.
  static constexpr int64_t kSilentUs = 2'000'000, kOpeningUs = 15'000'000;

 private:
  int64_t ElapsedUs(int64_t now_us) const { return heard_us_ ? now_us - *heard_us_ : 0; }

  const int64_t give_up_us_;
  std::optional<int64_t> heard_us_;  // when the last frame came, or the first look
  bool has_begun_ = false;           // a frame came
  bool is_silent_ = false;           // and that is told
  bool has_given_up_ = false;
};

}  // namespace tessera
