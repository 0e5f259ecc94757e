// A map file comes back as it was written; whatever is wrong with one is told in one sentence.
#include "wire/map_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include "core/errors.h"
#include "messages/topics.h"
#include "support/map_changes.h"
#include "support/matchers.h"
#include "wire/codec.h"
#include "wire/log_file.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

Map MadeMap(int num_deltas) {
  std::mt19937 generator(1);
  Map map;
  for (int i = 0; i < num_deltas; ++i) RandomChange(map, generator);
  return map;
}

void ExpectSame(const Map& map, const Map& other) {
  EXPECT_EQ(map.hash(), other.hash());
  EXPECT_EQ(map.Sha256Hex(), other.Sha256Hex());
  EXPECT_EQ(map.answered(), other.answered());
  EXPECT_EQ(map.next_delta(), other.next_delta());
  EXPECT_EQ(map.closed_loops(), other.closed_loops());
}

class MapFileTest : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  std::string ReadBytes() const {
    std::ifstream file(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  void WriteBytes(const std::string& bytes) const { std::ofstream(path_, std::ios::binary) << bytes; }

  // What reading and applying the file ends with: one sentence, which names the file if it can't be read; empty if it
  // is a map.
  std::string Problem() const {
    try {
      Map read;
      const Result<> applied = read.Apply(ReadMapFile(path_));
      return applied ? "" : applied.error().sentence;
    } catch (const InputError& error) {
      const std::string sentence = error.what();
      EXPECT_TRUE(sentence.starts_with("map file " + path_)) << sentence;
      EXPECT_EQ(sentence.find('\n'), std::string::npos) << sentence;
      return sentence;
    }
  }

  const std::string folder_ = testing::TempDir() + "map_file_test";
  const std::string path_ = folder_ + "/map.tessera";
};

TEST_F(MapFileTest, AMapComesBackTheSame) {
  for (const int num_deltas : {1, 2, 30}) {
    const Map map = MadeMap(num_deltas);
    WriteMapFile(map, path_);
    Map read;
    ASSERT_THAT(read.Apply(ReadMapFile(path_)), IsSuccess());
    ExpectSame(read, map);
    EXPECT_FALSE(fs::exists(path_ + ".part"));
  }
}

TEST_F(MapFileTest, AFileCutAnywhereIsRefused) {
  WriteMapFile(MadeMap(12), path_);
  const std::string whole = ReadBytes();
  std::vector<size_t> lengths;
  for (size_t tenth = 0; tenth < 10; ++tenth) lengths.push_back(tenth * whole.size() / 10);
  LogFileReader reader(path_);
  for (LogEvent event; reader.Next(&event);) {  // where a cut can't be seen in the events themselves
    const auto border = static_cast<size_t>(reader.position());
    for (const size_t length : {border - 1, border, border + 1}) {
      if (length < whole.size()) lengths.push_back(length);
    }
  }
  EXPECT_GT(lengths.size(), 20U);
  for (const size_t length : lengths) {
    WriteBytes(whole.substr(0, length));
    EXPECT_NE(Problem(), "") << "cut to " << length << " of " << whole.size() << " bytes";
  }
  WriteBytes(whole + whole);
  EXPECT_NE(Problem(), "") << "two maps in a row";
  WriteBytes(whole);
  EXPECT_EQ(Problem(), "");
}

// What is read is the map that was written, or nothing.
TEST_F(MapFileTest, AFlippedByteIsFoundOrDoesNoHarm) {
  const Map map = MadeMap(5);
  WriteMapFile(map, path_);
  const std::string whole = ReadBytes();
  size_t num_refused = 0, num_tried = 0;
  for (size_t at = 0; at < whole.size(); at += 11) {
    std::string flipped = whole;
    flipped[at] = static_cast<char>(flipped[at] ^ (1 << (at % 8)));
    WriteBytes(flipped);
    ++num_tried;
    if (!Problem().empty()) {
      ++num_refused;
      continue;
    }
    SCOPED_TRACE("byte " + std::to_string(at) + " of " + std::to_string(whole.size()));
    Map read;
    ASSERT_THAT(read.Apply(ReadMapFile(path_)), IsSuccess());
    ExpectSame(read, map);
  }
  EXPECT_GT(num_refused, num_tried * 9 / 10);
}

TEST_F(MapFileTest, AnotherVersionIsNamed) {
  WriteMapFile(MadeMap(3), path_);
  std::vector<LogEvent> events;
  LogFileReader reader(path_);
  for (LogEvent event; reader.Next(&event);) events.push_back(event);
  ValueJoiner<MapFileHeader> joiner;
  const Result<const MapFileHeader*> first = joiner.Add(events[0].data, *ReadHeader(events[0].data));
  ASSERT_TRUE(first && *first != nullptr);
  MapFileHeader header = **first;
  ++header.version;
  LogFileWriter writer(path_);
  writer.Write(0, events[0].channel, EncodeValue(header, {.publisher = "map_file", .epoch_us = 1}, 60000).front());
  for (size_t i = 1; i < events.size(); ++i) writer.Write(0, events[i].channel, events[i].data);
  writer.Close();
  EXPECT_NE(Problem().find("another version"), std::string::npos) << Problem();
}

TEST_F(MapFileTest, WhatIsNoMapIsRefused) {
  EXPECT_NE(Problem(), "") << "there is no such file";
  WriteBytes("");
  EXPECT_NE(Problem(), "");
  WriteBytes("ply\nformat ascii 1.0\n");
  EXPECT_NE(Problem(), "");
  LogFileWriter log(path_);
  log.Write(0, "POSE", EncodeValue(PoseEstimate{.frame = {1}}, {.publisher = "tracker", .epoch_us = 1}, 60000).front());
  log.Close();
  EXPECT_NE(Problem().find("no map"), std::string::npos) << Problem();
}

TEST_F(MapFileTest, AMapWithoutKeyframesIsNotLoaded) {
  WriteMapFile(Map(), path_);
  EXPECT_NE(Problem().find("no keyframes"), std::string::npos) << Problem();
}

TEST_F(MapFileTest, APathThatCantBeWrittenLeavesNothing) {
  const Map map = MadeMap(3);
  EXPECT_THROW(WriteMapFile(map, folder_ + "/none/map.tessera"), InputError);
  EXPECT_FALSE(fs::exists(folder_ + "/none"));
  fs::create_directories(path_ + "/something");  // a folder stands where the file should be
  EXPECT_THROW(WriteMapFile(map, path_), InputError);
  EXPECT_TRUE(fs::is_directory(path_ + "/something"));
  EXPECT_FALSE(fs::exists(path_ + ".part"));
}

}  // namespace
}  // namespace tessera
