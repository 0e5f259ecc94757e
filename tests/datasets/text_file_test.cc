// Rows of fields, and complaints that name file and line.
#include "datasets/text_file.h"

#include <gtest/gtest.h>

#include "support/dataset_folder.h"
#include "support/matchers.h"

namespace tessera {
namespace {

using testing::ThrowsMessage;

TEST(ReadRows, SplitsAtBlanksTabsAndCommasAndSkipsComments) {
  const DatasetFolder folder;
  folder.Write("a.txt", "# time x\n1.5 2\t3\n\n  4,5 , 6\r\n");
  const std::vector<TextRow> rows = ReadRows(folder.path("a.txt"));
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].fields, (std::vector<std::string>{"1.5", "2", "3"}));
  EXPECT_EQ(rows[1].fields, (std::vector<std::string>{"4", "5", "6"}));
  EXPECT_EQ(rows[1].location, folder.path("a.txt") + " line 4");
  EXPECT_EQ(rows[0].Number(0), 1.5);
  EXPECT_EQ(rows[1].Integer(2), 6);
}

TEST(ReadRows, BadFieldsAreNamed) {
  const TextRow row{"t.txt line 3", {"1.5", "x", "nan"}};
  EXPECT_THAT([&] { (void)row.Number(1); }, ThrowsMessage<InputError>(HasSubstr("t.txt line 3: field 2, `x`")));
  EXPECT_THAT([&] { (void)row.Number(2); }, ThrowsMessage<InputError>(HasSubstr("not a number")));
  EXPECT_THAT([&] { (void)row.Number(3); }, ThrowsMessage<InputError>(HasSubstr("at least 4")));
  EXPECT_THAT([&] { (void)row.Integer(0); }, ThrowsMessage<InputError>(HasSubstr("not a whole number")));
}

TEST(ReadRows, MissingAndEmptyFilesAreRefused) {
  const DatasetFolder folder;
  folder.Write("empty.txt", "# nothing\n");
  EXPECT_THAT([&] { (void)ReadRows(folder.path("empty.txt")); }, ThrowsMessage<InputError>(HasSubstr("no rows")));
  EXPECT_THAT([&] { (void)ReadRows(folder.path("none.txt")); }, ThrowsMessage<InputError>(HasSubstr("none.txt")));
}

TEST(ParseNumber, TakesTheWholeTextOrNothing) {
  double number = 0.0;
  EXPECT_TRUE(ParseNumber("+1e-3", number));
  EXPECT_EQ(number, 1e-3);
  for (const char* text : {"", "1.5m", "inf", "nan", "+"}) EXPECT_FALSE(ParseNumber(text, number)) << text;
}

TEST(ReadRows, TimesAreRoundedToTheNearestMicrosecond) {
  const TextRow row{"t.txt line 3", {"1.0000004", "1403636579.763555527", "1403636579763555527"}};
  EXPECT_EQ(row.TimeUs(0), 1000000);
  EXPECT_EQ(row.TimeUs(1), 1403636579763556);
  EXPECT_EQ(row.TimeNs(2), 1403636579763555527);
}

// Their differences would not be numbers.
TEST(ReadRows, TimesInNoCenturyAreRefused) {
  for (const char* text : {"1e300", "-9e12", "9223372036854775807", "-9000000000000000000"}) {
    const TextRow row{"t.txt line 3", {text}};
    EXPECT_THAT([&] { (void)row.TimeUs(0); }, ThrowsMessage<InputError>(HasSubstr("line 3: field 1"))) << text;
    EXPECT_THAT([&] { (void)row.TimeNs(0); }, ThrowsMessage<InputError>(HasSubstr("line 3: field 1"))) << text;
  }
}

}  // namespace
}  // namespace tessera
