#include "runtime/run_dir.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <fstream>

#include "core/errors.h"

namespace tessera {
namespace {

constexpr int64_t kMaxEpochUs = int64_t{1} << 55;  // half of what a header may say; beyond, the file is damaged

// Written beside, made to last, and renamed: the power may fail at any time.
void KeepNumber(const std::string& path, int64_t number) {
  const std::string text = std::to_string(number) + "\n";
  const std::string written = path + ".part";
  const int file = open(written.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (file < 0) return;
  const bool is_kept = write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && fsync(file) == 0;
  close(file);
  if (is_kept) std::rename(written.c_str(), path.c_str());
}

}  // namespace

Authenticator::Secret ReadRunSecret(const std::string& run_dir) {
  const std::string path = run_dir + "/secret";
  struct stat status{};
  if (stat(path.c_str(), &status) != 0) {
    throw InputError("the run's secret " + path + " can't be read (" + std::strerror(errno) +
                     "): `tessera run` and deputies make it; set bus.run_dir to \"\" to do without");
  }
  if ((status.st_mode & 077) != 0) {
    throw InputError("the run's secret " + path + " can be read by others; do: chmod 600 " + path);
  }
  std::string text;
  std::ifstream(path) >> text;
  Authenticator::Secret secret{};
  for (size_t i = 0; i < secret.size(); ++i) {
    const char* digits = text.data() + 2 * i;
    if (text.size() != 2 * secret.size() || std::from_chars(digits, digits + 2, secret[i], 16).ptr != digits + 2) {
      throw InputError("the run's secret " + path + " is damaged: it has to be " + std::to_string(2 * secret.size()) +
                       " hexadecimal digits; start the run again");
    }
  }
  return secret;
}

int64_t BeginEpoch(const std::string& run_dir, const std::string& name, int64_t wall_us) {
  if (run_dir.empty()) return wall_us;
  const std::string path = run_dir + "/epoch-" + name;
  int64_t last_us = 0;
  std::ifstream(path) >> last_us;
  if (last_us < 0 || last_us >= kMaxEpochUs) last_us = 0;
  const int64_t epoch_us = std::max(wall_us, last_us + 1);
  KeepNumber(path, epoch_us);
  return epoch_us;
}

}  // namespace tessera
