#include "core/files.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "core/errors.h"
#include "support/temporary_folder.h"

namespace tessera {
namespace {

TEST(WriteFile, ReplacesTheOldFileAndLeavesNothingBeside) {
  const TemporaryFolder folder;
  WriteFile(folder.path("a.txt"), "old and longer");
  WriteFile(folder.path("a.txt"), std::string("new\0text", 8));
  EXPECT_EQ(ReadFile(folder.path("a.txt")), std::string("new\0text", 8));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(WriteFile, RefusesWhatItCannotReplace) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder.path("dir.txt/inside"));
  EXPECT_THROW(WriteFile(folder.path("none/a.txt"), "x"), InputError);
  EXPECT_THROW(WriteFile(folder.path("dir.txt"), "x"), InputError);
  EXPECT_FALSE(std::filesystem::exists(folder.path("dir.txt.unfinished")));
}

TEST(ReadFile, RefusesFoldersAndMissingFiles) {
  const TemporaryFolder folder;
  EXPECT_THROW((void)ReadFile(folder.path("none.txt")), InputError);
  EXPECT_THROW((void)ReadFile(folder.path()), InputError);
}

}  // namespace
}  // namespace tessera
