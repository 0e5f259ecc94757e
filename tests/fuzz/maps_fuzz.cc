// Map files: the log that holds them, its messages, and the map that they make.
//
// Input: messages as pieces, of which a log is made; the first one is the file's header.
#include "fuzz/fuzz_target.h"
#include "messages/topics.h"
#include "support/example_values.h"
#include "wire/log_file.h"

namespace tessera {
namespace {

// Keyframes that see the same landmarks.
MapDelta SmallMap(std::mt19937& generator) {
  MapDelta delta = DrawValue<MapDelta>(generator, 0);
  Map map;
  if (!map.Apply(delta)) return delta;
  return map.Snapshot();
}

}  // namespace

std::vector<std::string> Seeds() {
  const FuzzFolder folder;
  std::vector<std::string> seeds;
  for (const int seed : {1, 2, 3}) {
    std::mt19937 generator(static_cast<unsigned>(seed));
    Map map;
    (void)map.Apply(SmallMap(generator));
    WriteMapFile(map, folder.path("map"));
    LogFileReader file(folder.path("map"));
    std::string pieces;
    for (LogEvent event; file.Next(&event);) {
      pieces += Piece({reinterpret_cast<const char*>(event.data.data()), event.data.size()});
    }
    seeds.push_back(pieces);
  }
  return seeds;
}

void Read(std::string_view text) {
  static const FuzzFolder folder;
  FuzzInput input(text);
  {
    LogFileWriter file(folder.path("map"));
    bool is_first = true;
    while (!input.is_empty()) {
      const std::string_view piece = input.TakePiece();
      file.Write(0, is_first ? "MAP_FILE" : kMapSnapshot.name, Bytes(piece.begin(), piece.end()));
      is_first = false;
    }
    file.Close();
  }
  ExpectSentence([] {
    Map map;
    (void)map.Apply(ReadMapFile(folder.path("map")));
  });
}

}  // namespace tessera
