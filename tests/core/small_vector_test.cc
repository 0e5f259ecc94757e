#include "core/small_vector.h"

#include <gtest/gtest.h>

#include <random>
#include <utility>
#include <vector>

namespace tessera {
namespace {

using List = SmallVector<int, 3>;

std::vector<int> Values(const List& list) { return {list.begin(), list.end()}; }

// Elements 0 .. size - 1.
List Counting(int size) {
  List list;
  for (int i = 0; i < size; ++i) list.Insert(list.end(), i);
  return list;
}

TEST(SmallVector, HoldsWhatAVectorHolds) {
  std::mt19937 generator(1);
  List list;
  std::vector<int> expected;
  for (int i = 0; i < 1000; ++i) {
    const auto at = static_cast<ptrdiff_t>(generator() % (expected.size() + 1));
    if (generator() % 2 == 0 || at == static_cast<ptrdiff_t>(expected.size())) {
      list.Insert(list.begin() + at, i);
      expected.insert(expected.begin() + at, i);
    } else {
      list.Remove(list.begin() + at);
      expected.erase(expected.begin() + at);
    }
    ASSERT_EQ(Values(list), expected);
    ASSERT_EQ(list.size(), expected.size());
  }
}

TEST(SmallVector, AnElementOfItselfCanBeInserted) {
  for (const int size : {2, 3, 7}) {
    List list = Counting(size);
    list.Insert(list.begin(), *(list.end() - 1));
    EXPECT_EQ(*list.begin(), size - 1);
    EXPECT_EQ(*(list.end() - 1), size - 1);
  }
}

TEST(SmallVector, CopiesAreValuesAndAMovedListIsEmpty) {
  for (const int size : {0, 3, 8}) {
    for (const int old_size : {0, 2, 9}) {
      List list = Counting(size), copy = Counting(old_size), moved = Counting(old_size);
      copy = list;
      EXPECT_EQ(Values(copy), Values(list));
      moved = std::move(list);
      EXPECT_EQ(Values(moved), Values(copy));
      EXPECT_EQ(list.size(), 0U);
      list = copy;
      list.Insert(list.begin(), 100);
      EXPECT_EQ(Values(moved), Values(copy));
      EXPECT_EQ(list.size(), copy.size() + 1);
    }
  }
}

}  // namespace
}  // namespace tessera
