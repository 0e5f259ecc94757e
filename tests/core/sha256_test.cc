#include "core/sha256.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

// Vectors of FIPS 180-4.
TEST(Sha256, AgreesWithTheStandard) {
  Sha256 empty;
  EXPECT_EQ(empty.HexDigest(), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  Sha256 abc;
  abc.Add("abc", 3);
  EXPECT_EQ(abc.HexDigest(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(Sha256, SeesTheLastBitOfADouble) {
  Sha256 a, b;
  a.Add(1.0);
  b.Add(1.0 + 2.220446049250313e-16);
  EXPECT_NE(a.HexDigest(), b.HexDigest());
}

TEST(Sha256, GoesOnAfterADigest) {
  Sha256 split, whole;
  split.Add("ab", 2);
  split.HexDigest();
  split.Add("c", 1);
  whole.Add("abc", 3);
  EXPECT_EQ(split.HexDigest(), whole.HexDigest());
}

}  // namespace
}  // namespace tessera
