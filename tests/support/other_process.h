// Runs a test's computation in another process, whose memory lies elsewhere: no address may decide a result.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>

namespace tessera {

// To be called by a test with the digest it computed. In the process that was asked for it, prints it. Otherwise starts
// this program again for the same test alone, and expects the same digest from there. Linux.
inline void ExpectSameInAnotherProcess(const std::string& digest) {
  constexpr const char* kAsked = "TESSERA_PRINT_DIGEST";
  constexpr const char* kMark = "digest=";
  if (std::getenv(kAsked) != nullptr) {
    std::printf("%s%s\n", kMark, digest.c_str());
    return;
  }
  const testing::TestInfo& test = *testing::UnitTest::GetInstance()->current_test_info();
  const std::string command = std::string("p=$(readlink -f /proc/$PPID/exe); ") + kAsked +
                              "=1 \"$p\" --gtest_filter=" + test.test_suite_name() + "." + test.name();
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  ASSERT_NE(pipe, nullptr);
  std::string output;
  char part[4096];
  for (size_t size; (size = std::fread(part, 1, sizeof part, pipe.get())) > 0;) output.append(part, size);
  const size_t at = output.find(kMark);
  ASSERT_NE(at, std::string::npos) << output;
  EXPECT_EQ(output.substr(at + std::string(kMark).size(), digest.size()), digest);
}

}  // namespace tessera
