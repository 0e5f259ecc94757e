#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "core/errors.h"
#include "core/files.h"
#include "place_recognition/vocabulary.h"
#include "place_recognition/vocabulary_training.h"
#include "support/planted_descriptors.h"
#include "support/temporary_folder.h"

namespace tessera {
namespace {

class VocabularyFileTest : public testing::Test {
 protected:
  VocabularyFileTest() {
    VocabularyTree tree = TrainVocabulary({RandomDescriptors(12, 1), RandomDescriptors(9, 2)},
                                          {.num_children = 3, .num_levels = 2, .direct_level = 1});
    tree.origin = "two images that nobody took";
    tree_ = tree;
    Vocabulary(tree).Save(path_);
  }

  // The sentence with which a file of this text is refused; empty if it isn't.
  std::string Refusal(const std::string& text) const {
    std::filesystem::remove(path_);  // overwriting would wait for the disk, each time
    folder_.Write("vocabulary.tvoc", text);
    try {
      Vocabulary::Load(path_);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  const TemporaryFolder folder_;
  const std::string path_ = folder_.path("vocabulary.tvoc");
  VocabularyTree tree_;
};

TEST_F(VocabularyFileTest, LoadsWhatWasSaved) {
  EXPECT_EQ(Vocabulary::Load(path_)->tree(), tree_);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_.path()), {}), 1);  // nothing is left beside
}

TEST_F(VocabularyFileTest, SavesTheSameBytesAgain) {
  const std::string text = ReadFile(path_);
  Vocabulary::Load(path_)->Save(path_);
  EXPECT_EQ(ReadFile(path_), text);
}

TEST_F(VocabularyFileTest, RefusesEveryCut) {
  const std::string text = ReadFile(path_);
  for (size_t length = 0; length < text.size(); ++length) {
    const std::string refusal = Refusal(text.substr(0, length));
    EXPECT_NE(refusal.find("truncated"), std::string::npos) << "cut at " << length << ": " << refusal;
    EXPECT_NE(refusal.find(path_), std::string::npos);
  }
  EXPECT_EQ(Refusal(text), "");
}

TEST_F(VocabularyFileTest, RefusesEveryFlippedByte) {
  const std::string text = ReadFile(path_);
  for (size_t i = 0; i < text.size(); ++i) {
    std::string flipped = text;
    flipped[i] = static_cast<char>(flipped[i] ^ 0x55);
    EXPECT_NE(Refusal(flipped), "") << "byte " << i;
  }
}

TEST_F(VocabularyFileTest, RefusesWhatIsAppended) {
  EXPECT_NE(Refusal(ReadFile(path_) + "x").find("damaged"), std::string::npos);
}

TEST_F(VocabularyFileTest, RefusesAnotherVersionByItsNumber) {
  std::string text = ReadFile(path_);
  text[std::string("tessera vocabulary\n").size()] = 7;
  const std::string refusal = Refusal(text);
  EXPECT_NE(refusal.find("is of version 7"), std::string::npos) << refusal;
}

TEST_F(VocabularyFileTest, RefusesWhatIsNoVocabulary) {
  EXPECT_NE(Refusal("%YAML 1.2\nthis: is a text of some other kind, long enough to hold a header\n")
                .find("is not a vocabulary"),
            std::string::npos);
  EXPECT_THROW(Vocabulary::Load(folder_.path("missing.tvoc")), InputError);
  EXPECT_THROW(Vocabulary::Load(folder_.path()), InputError);
}

TEST_F(VocabularyFileTest, SaysWhenItCantBeWritten) {
  EXPECT_THROW(Vocabulary(tree_).Save(folder_.path("no_such_folder/vocabulary.tvoc")), InputError);
}

}  // namespace
}  // namespace tessera
