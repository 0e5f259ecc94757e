// How well the occupancy map of a run shows what depth images show.
//
//   occupancy_accuracy RUN SOURCE [every=N] [range=METERS] [align=poses|positions] [poses=truth|run]
//   occupancy_accuracy /tmp/kitchen tum:../shared/data/rgbd/kitchen every=3
//   occupancy_accuracy /tmp/street sim:street-short range=20    # the run was stereo; the depth is the simulator's
//
// RUN holds trajectory.txt and occupancy.bt; SOURCE has depth images and true poses, of which every N-th frame counts.
// The true poses are brought into the run's world by one rigid motion, which aligns the trajectories. It is made of the
// whole poses: a depth image is seen from a position and in a direction, and where the path is short, positions alone
// leave open how the two worlds are turned against each other, which has nothing to do with the map. On long paths,
// align=positions gives the same. poses=run
// places the images by the run's own poses: what is measured then is the map alone. Points of the depth images up to
// `range` are sorted into the voxels of the map. Told is which share of the occupied voxels lies within two voxels of a
// depth point (precision), and of the voxels that hold points of at least 5 depth images, which share is occupied or
// has an occupied voxel within one or two (completeness).
#include <octomap/OcTree.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <unordered_map>

#include "core/errors.h"
#include "datasets/frame_source.h"
#include "geometry/alignment.h"

namespace tessera {
namespace {

constexpr int kMinImages = 5;
constexpr int kNear = 2;         // voxels
constexpr double kSeenAt = 2.0;  // m from the camera

struct Arguments {
  std::string run;
  SourceOptions source;
  std::map<std::string, std::string> texts = {{"every", "5"}, {"range", "4"}, {"align", "poses"}, {"poses", "truth"}};
};

Arguments ParseArguments(int argc, char** argv) {
  if (argc < 3) throw InputError("usage: occupancy_accuracy RUN SOURCE [every=N] [range=METERS] ...");
  Arguments arguments{.run = argv[1], .source = {.source = argv[2], .sensor = SensorType::kRgbd}};
  for (int i = 3; i < argc; ++i) {
    const std::string text = argv[i], key = text.substr(0, text.find('='));
    const auto found = arguments.texts.find(key);
    if (found == arguments.texts.end() || key == text) throw InputError("unknown argument `" + text + "`");
    found->second = text.substr(key.size() + 1);
  }
  return arguments;
}

// world_from_camera by time, us.
std::map<int64_t, Rigid3> ReadPoses(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw InputError("file " + path + " can't be read");
  std::map<int64_t, Rigid3> poses;
  for (std::string line; std::getline(file, line);) {
    std::istringstream row(line);
    double time_s = 0.0;
    Rigid3 pose;
    auto& position = pose.translation;
    auto& rotation = pose.rotation;
    if (row >> time_s >> position.x() >> position.y() >> position.z() >> rotation.x() >> rotation.y() >> rotation.z() >>
        rotation.w()) {
      poses.emplace(std::llround(1e6 * time_s), pose);
    }
  }
  return poses;
}

// A frame that both know.
struct PosePair {
  FrameId frame;
  Rigid3 run_from_camera;
  Rigid3 truth_from_camera;
};

std::vector<PosePair> PairPoses(const std::map<int64_t, Rigid3>& poses, const std::vector<GroundTruthPose>& truth) {
  constexpr int64_t kSameTimeUs = 100;
  std::vector<PosePair> pairs;
  for (const GroundTruthPose& pose : truth) {
    const auto found = poses.lower_bound(pose.utime_us - kSameTimeUs);
    if (found == poses.end() || found->first > pose.utime_us + kSameTimeUs) continue;
    pairs.push_back({pose.frame, found->second, pose.world_from_camera});
  }
  return pairs;
}

Rigid3 RunFromTruth(const std::vector<PosePair>& pairs, const std::string& alignment) {
  std::vector<Eigen::Vector3d> in_truth, in_run;
  for (const PosePair& pair : pairs) {
    in_truth.push_back(pair.truth_from_camera.translation);
    in_run.push_back(pair.run_from_camera.translation);
    if (alignment == "positions") continue;
    // A point on each axis of the camera, where it sees things: the rotation counts as it does for them.
    for (int axis = 0; axis < 3; ++axis) {
      for (const double side : {-kSeenAt, kSeenAt}) {
        const Eigen::Vector3d in_camera = side * Eigen::Vector3d::Unit(axis);
        in_truth.push_back(pair.truth_from_camera * in_camera);
        in_run.push_back(pair.run_from_camera * in_camera);
      }
    }
  }
  const auto found = AlignPoints(in_truth, in_run, /*with_scale=*/false);
  if (!found) throw InputError("the trajectory of the run and the true one have too few times in common");
  std::printf("%zu poses aligned by %s, RMS %.4f m\n", pairs.size(), alignment.c_str(), found->rms);
  return found->b_from_a.Pose();
}

using Cell = std::array<int32_t, 3>;
struct CellHash {
  size_t operator()(const Cell& cell) const {
    size_t hash = 0;
    for (const int32_t part : cell) hash = hash * 0x9E3779B97F4A7C15ULL + static_cast<uint32_t>(part);
    return hash ^ hash >> 29;
  }
};
struct Seen {
  int32_t num_images = 0;
  int64_t last_image = -1;
};
using Surface = std::unordered_map<Cell, Seen, CellHash>;

Cell CellOf(const Eigen::Vector3d& point, double edge) {
  Cell cell;
  for (size_t axis = 0; axis < 3; ++axis) {
    cell[axis] = static_cast<int32_t>(std::floor(point[static_cast<Eigen::Index>(axis)] / edge));
  }
  return cell;
}

void AddImage(const CameraFrame& frame, const CameraCalibration& camera, const Rigid3& run_from_camera, double range_m,
              double edge, Surface& surface) {
  constexpr int kStride = 2;
  for (int y = 0; y < frame.depth.height; y += kStride) {
    for (int x = 0; x < frame.depth.width; x += kStride) {
      const Eigen::Vector3d point = camera.depth_unit_m * frame.depth.row(y)[x] * camera.Ray({x, y});
      if (point.z() <= 0.0 || point.norm() > range_m) continue;
      Seen& seen = surface[CellOf(run_from_camera * point, edge)];
      if (seen.last_image != frame.id.value) ++seen.num_images;
      seen.last_image = frame.id.value;
    }
  }
}

// Whether `is_there` holds for a cell whose center is no farther than `max_distance`, in cells, from that of `cell`.
template <class IsThere>
bool IsNear(const Cell& cell, int max_distance, IsThere is_there) {
  for (int x = -max_distance; x <= max_distance; ++x) {
    for (int y = -max_distance; y <= max_distance; ++y) {
      for (int z = -max_distance; z <= max_distance; ++z) {
        if (x * x + y * y + z * z > max_distance * max_distance) continue;
        if (is_there(Cell{cell[0] + x, cell[1] + y, cell[2] + z})) return true;
      }
    }
  }
  return false;
}

void Tell(const octomap::OcTree& tree, const Surface& surface) {
  const double edge = tree.getResolution();
  std::unordered_map<Cell, bool, CellHash> occupied;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (!tree.isNodeOccupied(*leaf)) continue;
    const int num = static_cast<int>(std::lround(leaf.getSize() / edge));
    const Eigen::Vector3d corner = Eigen::Vector3d(leaf.getX(), leaf.getY(), leaf.getZ()).array() - leaf.getSize() / 2;
    for (int i = 0; i < num * num * num; ++i) {
      const Eigen::Vector3d offset(i % num + 0.5, i / num % num + 0.5, i / (num * num) + 0.5);
      occupied[CellOf(corner + edge * offset, edge)] = true;
    }
  }
  const auto is_surface = [&](const Cell& cell) { return surface.contains(cell); };
  const auto is_occupied = [&](const Cell& cell) { return occupied.contains(cell); };
  const auto num_right = std::count_if(occupied.begin(), occupied.end(),
                                       [&](const auto& cell) { return IsNear(cell.first, kNear, is_surface); });
  std::printf("%zu voxels of %.4g m occupied, within %d voxels of the depth images: %.2f %%\n", occupied.size(), edge,
              kNear,
              100.0 * static_cast<double>(num_right) / static_cast<double>(std::max<size_t>(1, occupied.size())));
  size_t num_surface = 0;
  std::array<size_t, kNear + 1> num_found{};
  for (const auto& [cell, seen] : surface) {
    if (seen.num_images < kMinImages) continue;
    ++num_surface;
    for (int distance = 0; distance <= kNear; ++distance) {
      num_found[static_cast<size_t>(distance)] += IsNear(cell, distance, is_occupied) ? 1 : 0;
    }
  }
  for (int distance = 0; distance <= kNear; ++distance) {
    const auto found = static_cast<double>(num_found[static_cast<size_t>(distance)]);
    std::printf("%zu voxels of surface in at least %d depth images, occupied within %d voxels: %.2f %%\n", num_surface,
                kMinImages, distance, 100.0 * found / static_cast<double>(std::max<size_t>(1, num_surface)));
  }
}

int Main(int argc, char** argv) {
  const Arguments arguments = ParseArguments(argc, argv);
  const octomap::OcTree tree(arguments.run + "/occupancy.bt");
  const auto source = OpenSource(arguments.source);
  const std::vector<PosePair> pairs = PairPoses(ReadPoses(arguments.run + "/trajectory.txt"), source->ground_truth());
  const Rigid3 run_from_truth = RunFromTruth(pairs, arguments.texts.at("align"));
  std::map<FrameId, Rigid3> poses;
  for (const PosePair& pair : pairs) {
    const bool is_run = arguments.texts.at("poses") == "run";
    poses.emplace(pair.frame, is_run ? pair.run_from_camera : run_from_truth * pair.truth_from_camera);
  }
  Surface surface;
  const int64_t every = std::stoll(arguments.texts.at("every"));
  while (const auto frame = source->Next()) {
    const auto pose = poses.find(frame->id);
    if (pose == poses.end() || frame->id.value % every != 0) continue;
    AddImage(*frame, source->calibration(), pose->second, std::stod(arguments.texts.at("range")), tree.getResolution(),
             surface);
  }
  Tell(tree, surface);
  return 0;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  try {
    return tessera::Main(argc, argv);
  } catch (const tessera::InputError& error) {
    std::cerr << error.what() << "\n";
    return 2;
  }
}
