#include "core/scratch_file.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "support/temporary_folder.h"

namespace tessera {
namespace {

TEST(ScratchFile, GivesBackWhatItWasGivenInAnyOrder) {
  const TemporaryFolder folder;
  ScratchFile file(folder.path() + "/made");
  const auto first = file.Put("first"), second = file.Put("the second"), empty = file.Put("");
  ASSERT_TRUE(first && second && empty);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path() + "/made")) << "it has no name";
  EXPECT_EQ(file.Take(*second), "the second");
  EXPECT_EQ(file.Take(*first), "first");
  EXPECT_EQ(file.Take(*empty), "");
}

TEST(ScratchFile, UsesRoomAgain) {
  const TemporaryFolder folder;
  ScratchFile file(folder.path());
  const auto first = file.Put("0123456789"), second = file.Put("abcdefghij");
  file.Drop(*first);
  const auto third = file.Put("short");
  ASSERT_TRUE(third.has_value());
  EXPECT_EQ(third->offset, first->offset);
  EXPECT_EQ(file.Take(*third), "short");
  EXPECT_EQ(file.Put("9876543210")->offset, first->offset) << "all of the room";
  EXPECT_EQ(file.Take(*second), "abcdefghij");
}

TEST(ScratchFile, SaysWhenThereIsNoRoom) {
  ScratchFile nowhere("/dev/null/folder");
  EXPECT_FALSE(nowhere.Put("bytes").has_value());
}

}  // namespace
}  // namespace tessera
