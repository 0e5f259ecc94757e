// tessera-vocabulary: trains a vocabulary of binary words and tells what is in one. Exit status 2 and one sentence on
// bad input.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "core/errors.h"
#include "features/extractor.h"
#include "features/selection.h"
#include "features/tiling.h"
#include "place_recognition/vocabulary_training.h"
#include "training_views.h"

namespace tessera {
namespace {

struct Arguments {
  std::string path;
  std::vector<std::string> sources;
  TrainingViewOptions views;
  VocabularyOptions vocabulary;
  FeatureOptions features;
};

FeatureFrame ExtractView(const GrayImage& image, const CameraCalibration& calibration, const FeatureOptions& options,
                         Extractor& extractor) {
  std::vector<TileFeatures> tiles;
  const CameraFrame frame{.id = FrameId{0}, .left = image};
  for (const TileJob& job : CutFrame(frame, calibration, 0, TileGrid{1, 1}, kMaxLevels, options)) {
    tiles.push_back(extractor.Extract(job));
  }
  return SelectFeatures(tiles).value().features;
}

// Descriptors by image, of the images that have any.
std::vector<std::vector<Descriptor>> CollectDescriptors(const Arguments& arguments) {
  std::vector<std::vector<Descriptor>> images;
  Extractor extractor;
  for (const std::string& source : arguments.sources) {
    const size_t num_before = images.size();
    const auto take = [&](const GrayImage& image, const CameraCalibration& calibration) {
      FeatureFrame features = ExtractView(image, calibration, arguments.features, extractor);
      if (!features.descriptors.empty()) images.push_back(std::move(features.descriptors));
    };
    const std::vector<std::string> skipped = ForEachTrainingView(source, arguments.views, take);
    for (const std::string& sentence : skipped) std::cerr << "left out: " << sentence << "\n";
    std::printf("%s: %zu images\n", source.c_str(), images.size() - num_before);
    std::fflush(stdout);
  }
  return images;
}

void Print(const Vocabulary& vocabulary) {
  const VocabularyTree& tree = vocabulary.tree();
  std::printf("words %d, nodes %zu, direct index in level %d\n%s\n", vocabulary.num_words(), tree.num_children.size(),
              tree.direct_level, tree.origin.c_str());
}

void Train(const Arguments& arguments) {
  ThrowIfFailed<InputError>(arguments.vocabulary.Check());
  ThrowIfFailed<InputError>(arguments.features.Check());
  const std::vector<std::vector<Descriptor>> images = CollectDescriptors(arguments);
  size_t num_descriptors = 0;
  for (const auto& image : images) num_descriptors += image.size();
  if (num_descriptors == 0) throw InputError("the sources hold no image with features: give others");
  std::printf("training on %zu descriptors of %zu images\n", num_descriptors, images.size());
  std::fflush(stdout);
  VocabularyTree tree = TrainVocabulary(images, arguments.vocabulary);
  tree.origin = "trained on " + std::to_string(num_descriptors) + " descriptors of " + std::to_string(images.size()) +
                " images: every frame in " + std::to_string(arguments.views.every) + ", " +
                std::to_string(arguments.views.num_views) +
                " views of each photo; k = " + std::to_string(arguments.vocabulary.num_children) + ", seed " +
                std::to_string(arguments.vocabulary.seed);
  const Vocabulary vocabulary(std::move(tree));
  vocabulary.Save(arguments.path);
  Print(vocabulary);
}

void AddTrainingOptions(CLI::App& train, Arguments& arguments) {
  train.add_option("OUT", arguments.path, "the file to write")->required();
  train.add_option("SOURCE", arguments.sources, "a source as of `run`, or a folder of photos")->required();
  train.add_option("--every", arguments.views.every, "take one frame in so many of a source")
      ->check(CLI::PositiveNumber);
  train.add_option("--views", arguments.views.num_views, "views cut out of each photo")->check(CLI::PositiveNumber);
  train.add_option("--camera", arguments.views.calibration_path, "calibration, where the source brings none");
  train.add_option("--features", arguments.features.num_features, "keypoints per image");
  train.add_option("--children", arguments.vocabulary.num_children, "into which each node is split");
  train.add_option("--levels", arguments.vocabulary.num_levels, "of the tree below its root");
  train.add_option("--direct-level", arguments.vocabulary.direct_level, "of the direct index");
  train.add_option("--seed", arguments.vocabulary.seed, "of the choice of first centers, and of views");
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  tessera::Arguments arguments;
  CLI::App app("Vocabularies of binary words.");
  app.require_subcommand(1);
  CLI::App* train = app.add_subcommand("train", "learns one from images");
  tessera::AddTrainingOptions(*train, arguments);
  CLI::App* info = app.add_subcommand("info", "checks one and tells what is in it");
  info->add_option("FILE", arguments.path, "the vocabulary")->required();
  CLI11_PARSE(app, argc, argv);
  arguments.views.seed = arguments.vocabulary.seed;
  try {
    if (train->parsed()) tessera::Train(arguments);
    if (info->parsed()) tessera::Print(*tessera::Vocabulary::Load(arguments.path));
  } catch (const tessera::InputError& error) {
    std::cerr << error.what() << "\n";
    return 2;
  }
  return 0;
}
