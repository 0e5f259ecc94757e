#include "core/project_file.h"

#include <gtest/gtest.h>

#include <filesystem>

namespace tessera {
namespace {

TEST(ProjectFile, IsFoundInAFolderAboveTheProgram) {
  const auto found = FindProjectFile("config/default.yaml");
  ASSERT_TRUE(found.has_value());
  EXPECT_TRUE(std::filesystem::equivalent(*found, TESSERA_SOURCE_DIR "/config/default.yaml"));
}

TEST(ProjectFile, IsNothingWhereNoFolderHasIt) {
  EXPECT_FALSE(FindProjectFile("config/of_another_project.yaml").has_value());
  EXPECT_FALSE(FindProjectFile("config").has_value());  // a folder
}

}  // namespace
}  // namespace tessera
