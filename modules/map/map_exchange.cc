#include "map/map_exchange.h"

#include <algorithm>

namespace tessera {
namespace {

// Each about 200 kB on the wire: a keyframe has 108 kB of features, a landmark 104 bytes, an observation 20.
constexpr size_t kKeyframesPerPage = 2;
constexpr size_t kLandmarksPerPage = 2048;
constexpr size_t kObservationsPerPage = 8192;

size_t NumPages(size_t num_items, size_t per_page) { return (num_items + per_page - 1) / per_page; }

template <class Item>
void CopyPage(const std::vector<Item>& all, size_t page, size_t per_page, std::vector<Item>* part) {
  const size_t begin = std::min(all.size(), page * per_page), end = std::min(all.size(), begin + per_page);
  part->assign(all.begin() + static_cast<std::ptrdiff_t>(begin), all.begin() + static_cast<std::ptrdiff_t>(end));
}

template <class Item>
void Append(const std::vector<Item>& part, std::vector<Item>* whole) {
  whole->insert(whole->end(), part.begin(), part.end());
}

}  // namespace

int32_t NumSnapshotPages(const MapDelta& snapshot) {
  const size_t num_pages = NumPages(snapshot.new_keyframes.size(), kKeyframesPerPage) +
                           NumPages(snapshot.changed_landmarks.size(), kLandmarksPerPage) +
                           NumPages(snapshot.new_observations.size(), kObservationsPerPage);
  return static_cast<int32_t>(std::max<size_t>(1, num_pages));
}

// Keyframes come first, then landmarks, then observations, which need both.
MapSnapshotPage CutSnapshotPage(const MapDelta& snapshot, int32_t page) {
  MapSnapshotPage cut;
  cut.page = page;
  cut.num_pages = NumSnapshotPages(snapshot);
  cut.part.number = snapshot.number;
  cut.part.answers = snapshot.answers;
  cut.part.is_snapshot = true;
  cut.part.hash = snapshot.hash;
  cut.part.lens = snapshot.lens;
  if (page == 0) cut.part.closed_loops = snapshot.closed_loops;
  auto left = static_cast<size_t>(page);
  const size_t num_keyframe_pages = NumPages(snapshot.new_keyframes.size(), kKeyframesPerPage);
  const size_t num_landmark_pages = NumPages(snapshot.changed_landmarks.size(), kLandmarksPerPage);
  if (left < num_keyframe_pages) {
    CopyPage(snapshot.new_keyframes, left, kKeyframesPerPage, &cut.part.new_keyframes);
  } else if ((left -= num_keyframe_pages) < num_landmark_pages) {
    CopyPage(snapshot.changed_landmarks, left, kLandmarksPerPage, &cut.part.changed_landmarks);
  } else {
    left -= num_landmark_pages;
    CopyPage(snapshot.new_observations, left, kObservationsPerPage, &cut.part.new_observations);
  }
  return cut;
}

void AppendPage(const MapSnapshotPage& page, MapDelta* snapshot) {
  Append(page.part.new_keyframes, &snapshot->new_keyframes);
  Append(page.part.changed_landmarks, &snapshot->changed_landmarks);
  Append(page.part.new_observations, &snapshot->new_observations);
}

}  // namespace tessera
