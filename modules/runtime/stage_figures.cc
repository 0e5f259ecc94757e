#include "runtime/stage_figures.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <numeric>

#include "core/quantile.h"
#include "core/time_units.h"
#include "core/version.h"

namespace tessera {
namespace {

// Processor time of this process, by the kernel's accounting.
double CpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double ResidentMb() {
  std::ifstream statm("/proc/self/statm");
  int64_t num_pages = 0;
  int64_t num_resident_pages = 0;
  statm >> num_pages >> num_resident_pages;
  return 1e-6 * static_cast<double>(num_resident_pages * sysconf(_SC_PAGESIZE));
}

}  // namespace

StepStatistics StatisticsOf(std::vector<float> steps_ms) {
  StepStatistics statistics;
  statistics.count = static_cast<int64_t>(steps_ms.size());
  if (steps_ms.empty()) {
    return statistics;
  }
  std::sort(steps_ms.begin(), steps_ms.end());
  statistics.mean_ms = std::accumulate(steps_ms.begin(), steps_ms.end(), 0.0) / static_cast<double>(steps_ms.size());
  statistics.median_ms = Quantile(steps_ms, 0.5);
  statistics.p95_ms = Quantile(steps_ms, 0.95);
  statistics.p99_ms = Quantile(steps_ms, 0.99);
  statistics.max_ms = static_cast<double>(steps_ms.back());
  return statistics;
}

StageFigures::StageFigures(const StageIdentity& identity) {
  status_.name = identity.name;
  status_.host = identity.host;
  status_.version = kVersion;
  status_.pid = identity.pid;
  status_.epoch_us = identity.epoch_us;
}

void StageFigures::SetValue(const std::string& name, double value) {
  auto& values = status_.values;
  const auto it = std::find_if(values.begin(), values.end(), [&](const auto& entry) { return entry.first == name; });
  if (it == values.end()) {
    values.emplace_back(name, value);
  } else {
    it->second = value;
  }
}

StageStatus StageFigures::MakeStatus(StageState state, const StreamCounts& counts, int64_t num_undecodable,
                                     int64_t num_strangers, int64_t now_us, bool is_final) {
  constexpr int64_t kStatisticsPeriodUs = 1'000'000;
  constexpr size_t kMaxSentenceLength = 300;  // so that a status is one message also on a LAN
  const double cpu_s = CpuSeconds();
  const double elapsed_s = SecondsOf(now_us - status_us_);
  if (elapsed_s > 0.01) {
    status_.cpu_percent = 100.0 * (cpu_s - status_.cpu_s) / elapsed_s;
    status_us_ = now_us;
    status_.cpu_s = cpu_s;
  }
  if (is_final || now_us - statistics_us_ >= kStatisticsPeriodUs) {
    status_.step = StatisticsOf(steps_ms_);
    statistics_us_ = now_us;
  }
  status_.state = state;
  status_.num_received = num_received;
  status_.num_published = num_published;
  status_.num_dropped = num_dropped;
  status_.num_repaired = counts.num_repaired;
  status_.num_lost = counts.num_lost;
  status_.num_undecodable = num_undecodable;
  status_.num_strangers = num_strangers;
  status_.queue = queue;
  status_.rss_mb = ResidentMb();
  status_.last_error = last_error.substr(0, kMaxSentenceLength);
  return status_;
}

}  // namespace tessera
