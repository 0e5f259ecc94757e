#include "core/result.h"

#include <gmock/gmock.h>

#include <stdexcept>

#include "support/matchers.h"

namespace tessera {
namespace {

Result<int> Half(int number) {
  if (number % 2 != 0) return Failed("the number is odd");
  return number / 2;
}

Result<> CheckQuarter(int number) {
  TESSERA_RETURN_IF_FAILED(Half(number));
  return Require(number % 4 == 0, "its half is odd");
}

TEST(Result, HoldsAValueOrTheProblem) {
  EXPECT_EQ(Half(6), 3);
  EXPECT_THAT(Half(7), IsFailure("the number is odd"));
}

TEST(Result, TheFirstProblemIsReturned) {
  EXPECT_THAT(CheckQuarter(8), IsSuccess());
  EXPECT_THAT(CheckQuarter(7), IsFailure("the number is odd"));
  EXPECT_THAT(CheckQuarter(6), IsFailure("its half is odd"));
}

TEST(Result, ThrowIfFailedPutsThePrefixBeforeTheSentence) {
  EXPECT_NO_THROW(ThrowIfFailed<std::invalid_argument>(CheckQuarter(8), "quarter: "));
  EXPECT_THAT([] { ThrowIfFailed<std::invalid_argument>(CheckQuarter(6), "quarter: "); },
              testing::ThrowsMessage<std::invalid_argument>("quarter: its half is odd"));
}

}  // namespace
}  // namespace tessera
