// Recall and precision of place recognition alone, without geometric checks, on a source with ground truth.
//
//   place_recall SOURCE OUT_DIR VOCABULARY... [key=value]...
//   place_recall kitti:../shared/data/torcs/g-track-3 /tmp/places config/vocabulary.tvoc spacing=2
//
// Frames are taken every `spacing` meters (or `turn` radians). Each asks for the best place among those at least
// `apart` meters of way before it. Its score is divided by the similarity with the frame before it, what a view of the
// same place would reach at best (Galvez-Lopez and Tardos 2012, eq. 2). The answer is true if the camera stood within
// `near` meters and `angle` radians of it. Of all frames that a true answer exists for, recall is the share that got
// one with a score above the threshold; precision is the share of true ones among all answers above it.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/errors.h"
#include "datasets/frame_source.h"
#include "features/extractor.h"
#include "features/selection.h"
#include "features/tiling.h"
#include "place_recognition/place_database.h"
#include "place_recognition/vocabulary.h"

namespace tessera {
namespace {

struct Arguments {
  SourceOptions source;
  std::filesystem::path out_dir;
  std::vector<std::string> vocabularies;
  double last_frame = -1.0;
  double spacing_m = 2.0;
  double turn_rad = 0.3;
  double apart_m = 50.0;
  double near_m = 10.0;
  double angle_rad = 0.6;
  double num_features = FeatureOptions{}.num_features;
};

Arguments ParseArguments(int argc, char** argv) {
  Arguments arguments;
  arguments.source.source = argv[1];
  arguments.out_dir = argv[2];
  const std::map<std::string, double*> keys = {{"last", &arguments.last_frame},      {"spacing", &arguments.spacing_m},
                                               {"turn", &arguments.turn_rad},        {"apart", &arguments.apart_m},
                                               {"near", &arguments.near_m},          {"angle", &arguments.angle_rad},
                                               {"features", &arguments.num_features}};
  for (int i = 3; i < argc; ++i) {
    const std::string text = argv[i], key = text.substr(0, text.find('='));
    if (key == text) {
      arguments.vocabularies.push_back(text);
    } else if (const auto found = keys.find(key); found != keys.end()) {
      *found->second = std::stod(text.substr(key.size() + 1));
    } else {
      throw InputError("unknown argument `" + key + "`");
    }
  }
  arguments.source.last_frame = static_cast<int64_t>(arguments.last_frame);
  return arguments;
}

// What a keyframe of the sequence is here.
struct View {
  FrameId frame;
  Rigid3 world_from_camera;
  double way_m = 0.0;  // from the start of the sequence to here
  std::vector<Descriptor> descriptors;
};

std::vector<View> CollectViews(const Arguments& arguments) {
  const auto source = OpenSource(arguments.source);
  std::map<FrameId, Rigid3> truth;
  for (const GroundTruthPose& pose : source->ground_truth()) truth[pose.frame] = pose.world_from_camera;
  if (truth.empty())
    throw InputError("source `" + arguments.source.source + "` has no ground truth: give one that has");
  const FeatureOptions options{.num_features = static_cast<int>(arguments.num_features)};
  Extractor extractor;
  std::vector<View> views;
  double way_m = 0.0;
  std::optional<Rigid3> previous;
  while (const auto frame = source->Next()) {
    const auto pose = truth.find(frame->id);
    if (pose == truth.end()) continue;
    if (previous) way_m += (pose->second.translation - previous->translation).norm();
    previous = pose->second;
    const bool is_due =
        views.empty() || way_m - views.back().way_m >= arguments.spacing_m ||
        views.back().world_from_camera.rotation.angularDistance(pose->second.rotation) >= arguments.turn_rad;
    if (!is_due) continue;
    std::vector<TileFeatures> tiles;
    for (const TileJob& job : CutFrame(*frame, source->calibration(), 0, TileGrid{1, 1}, kMaxLevels, options)) {
      tiles.push_back(extractor.Extract(job));
    }
    views.push_back({frame->id, pose->second, way_m, SelectFeatures(tiles).value().features.descriptors});
  }
  return views;
}

bool IsSamePlace(const View& a, const View& b, const Arguments& arguments) {
  return (a.world_from_camera.translation - b.world_from_camera.translation).norm() <= arguments.near_m &&
         a.world_from_camera.rotation.angularDistance(b.world_from_camera.rotation) <= arguments.angle_rad;
}

struct Answer {
  FrameId frame;
  FrameId place;             // invalid: none was found
  double score = 0.0;        // similarity with the place
  double normalized = 0.0;   // divided by the similarity with the view before
  double distance_m = -1.0;  // from the place
  bool is_true = false;
  bool has_truth = false;  // some earlier view is the same place
};

std::vector<Answer> AskForEach(const std::vector<View>& views, const Vocabulary& vocabulary,
                               const Arguments& arguments) {
  PlaceDatabase database;  // keyframes are numbered as views
  std::vector<Answer> answers;
  for (size_t i = 0; i < views.size(); ++i) {
    const View& view = views[i];
    const auto bag = std::make_shared<const BagOfWords>(vocabulary.Describe(view.descriptors));
    const auto is_old = [&](KeyframeId id) {
      return view.way_m - views[static_cast<size_t>(id.value)].way_m >= arguments.apart_m;
    };
    Answer answer{.frame = view.frame};
    for (size_t j = 0; j < i && is_old(KeyframeId{static_cast<int64_t>(j)}); ++j) {
      answer.has_truth = answer.has_truth || IsSamePlace(view, views[j], arguments);
    }
    const auto places = database.Query(*bag, is_old);
    if (!places.empty()) {
      const View& place = views[static_cast<size_t>(places[0].id.value)];
      const BagOfWords& before = *database.Find(KeyframeId{static_cast<int64_t>(i) - 1});
      answer.place = place.frame;
      answer.score = places[0].score;
      answer.normalized = answer.score / std::max(Similarity(*bag, before), 0.01);
      answer.distance_m = (view.world_from_camera.translation - place.world_from_camera.translation).norm();
      answer.is_true = IsSamePlace(view, place, arguments);
    }
    answers.push_back(answer);
    database.Add(KeyframeId{static_cast<int64_t>(i)}, bag);
  }
  return answers;
}

struct Curve {
  struct Point {
    double threshold, recall, precision;
  };
  std::vector<Point> points;    // from the highest threshold down
  double sure_recall = 0.0;     // the highest recall at 100 % precision
  double sure_threshold = 0.0;  // the lowest that still has it
  double best_false = 0.0;      // the highest score of an answer that is not true
};

// Answers in falling order of their scores; equal ones stand or fall together.
Curve MakeCurve(std::vector<Answer> answers, double Answer::* score) {
  const auto num_to_find = std::count_if(answers.begin(), answers.end(), [](const Answer& a) { return a.has_truth; });
  std::erase_if(answers, [](const Answer& answer) { return !answer.place.valid(); });
  std::sort(answers.begin(), answers.end(), [&](const Answer& a, const Answer& b) { return a.*score > b.*score; });
  Curve curve;
  double num_true = 0.0;
  for (size_t i = 0; i < answers.size(); ++i) {
    num_true += answers[i].is_true ? 1.0 : 0.0;
    if (!answers[i].is_true) curve.best_false = std::max(curve.best_false, answers[i].*score);
    if (i + 1 < answers.size() && answers[i + 1].*score == answers[i].*score) continue;
    const double threshold = answers[i].*score;
    const double recall = num_to_find > 0 ? num_true / static_cast<double>(num_to_find) : 0.0;
    const double precision = num_true / static_cast<double>(i + 1);
    curve.points.push_back({threshold, recall, precision});
    if (precision == 1.0) {
      curve.sure_recall = recall;
      curve.sure_threshold = threshold;
    }
  }
  return curve;
}

void WriteFiles(const std::vector<Answer>& answers, const Curve& curve, const std::filesystem::path& stem) {
  std::ofstream answer_file(stem.string() + "_answers.csv"), curve_file(stem.string() + "_curve.csv");
  answer_file << "frame,place,score,normalized,distance_m,is_true,has_truth\n";
  for (const Answer& a : answers) {
    answer_file << a.frame.value << ',' << a.place.value << ',' << a.score << ',' << a.normalized << ',' << a.distance_m
                << ',' << a.is_true << ',' << a.has_truth << '\n';
  }
  curve_file << "threshold,recall,precision\n";
  for (const Curve::Point& p : curve.points) curve_file << p.threshold << ',' << p.recall << ',' << p.precision << '\n';
  if (!answer_file || !curve_file) throw InputError("figures can't be written beside " + stem.string());
}

void Measure(const std::vector<View>& views, const std::string& path, const Arguments& arguments) {
  const std::vector<Answer> answers = AskForEach(views, *Vocabulary::Load(path), arguments);
  const Curve curve = MakeCurve(answers, &Answer::normalized), raw = MakeCurve(answers, &Answer::score);
  const auto count = [&](bool Answer::* what) {
    return std::count_if(answers.begin(), answers.end(), [&](const Answer& answer) { return answer.*what; });
  };
  std::printf("%s: views %zu, revisits %td, best place true %td\n", path.c_str(), views.size(),
              count(&Answer::has_truth), count(&Answer::is_true));
  for (const auto& [name, of] : {std::pair("score / neighbor's", &curve), std::pair("bare score", &raw)}) {
    std::printf("  %s: recall at 100 %% precision %.3f down to %.3f; best false answer %.3f\n", name, of->sure_recall,
                of->sure_threshold, of->best_false);
  }
  WriteFiles(answers, curve, arguments.out_dir / std::filesystem::path(path).stem());
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  if (argc < 4) {
    std::cerr
        << "usage: place_recall SOURCE OUT_DIR VOCABULARY... [spacing=2] [turn=0.3] [apart=50] [near=10] [angle=0.6] "
           "[last=-1] [features=2000]\n";
    return 2;
  }
  try {
    const tessera::Arguments arguments = tessera::ParseArguments(argc, argv);
    const std::vector<tessera::View> views = tessera::CollectViews(arguments);
    std::filesystem::create_directories(arguments.out_dir);
    for (const std::string& path : arguments.vocabularies) tessera::Measure(views, path, arguments);
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 2;
  }
  return 0;
}
