// Recorded logs and the checksums beside them, as sources and as schedules of replayed runs.
//
// Input: whether there are checksums, which are the next piece then; and the log.
#include <filesystem>
#include <fstream>
#include <iterator>

#include "fuzz/fuzz_target.h"
#include "messages/topics.h"
#include "support/example_values.h"
#include "wire/log.h"
#include "wire/log_file.h"
#include "wire/recorded_steps.h"

namespace tessera {
namespace {

template <class Value>
void Add(LogFileWriter& log, const Channel& channel, const Value& value, int64_t* sequence) {
  const MessageHeader header{.publisher = "camera", .epoch_us = 1000, .sequence = *sequence};
  for (const Bytes& message : EncodeValue(value, header, 1380)) {
    log.Write(*sequence, channel.name, message);
    ++*sequence;
  }
}

std::string ReadFileText(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// A recording of small frames, of `num_frames` of them, and its checksums.
std::pair<std::string, std::string> MadeLog(int num_frames) {
  const FuzzFolder folder;
  std::mt19937 generator(1);
  LogFileWriter log(folder.path("log"), Checksums::kBeside);
  int64_t calibrations = 0, frames = 0, truths = 0, poses = 0, ends = 0;
  Add(log, kCalibration, DrawValue<CameraCalibration>(generator, 0), &calibrations);
  for (int i = 0; i < num_frames; ++i) {
    CameraFrame frame = DrawValue<CameraFrame>(generator, 0);
    frame.id = {i};
    frame.utime_us = 50'000 * i;
    Add(log, kCamera, frame, &frames);
    Add(log, kGroundTruth, DrawValue<GroundTruthPose>(generator, 0), &truths);
    Add(log, kPose, DrawValue<PoseEstimate>(generator, 0), &poses);
  }
  Add(log, kEndOfStream, DrawValue<EndOfStream>(generator, 0), &ends);
  log.Close();
  return {ReadFileText(folder.path("log")), ReadFileText(folder.path("log.checksums"))};
}

}  // namespace

std::vector<std::string> Seeds() {
  std::vector<std::string> seeds;
  for (const int num_frames : {0, 1, 3}) {
    const auto [log, checksums] = MadeLog(num_frames);
    seeds.push_back(std::string(1, '\0') + log);
    seeds.push_back(std::string(1, '\1') + Piece(checksums) + log);
  }
  return seeds;
}

void Read(std::string_view text) {
  static const FuzzFolder folder;
  FuzzInput input(text);
  if (input.TakeByte() % 2 == 1) {
    folder.Write("log.checksums", input.TakePiece());
  } else {
    std::filesystem::remove(folder.path("log.checksums"));
  }
  folder.Write("log", input.TakeRest());
  ExpectSentence([] {
    LogReader reader(folder.path("log"));
    while (reader.Next()) {
    }
    (void)reader.loss();
  });
  ExpectSentence([] { (void)ReadRecordedSteps(folder.path("log"), ""); });
}

}  // namespace tessera
