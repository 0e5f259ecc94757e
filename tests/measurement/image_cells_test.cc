#include "measurement/image_cells.h"

#include <gmock/gmock.h>

#include <vector>

namespace tessera {
namespace {

using ::testing::ElementsAre;

ImageCells CellsOf(int width_px, int height_px, int num_along) {
  return {{.width_px = width_px, .height_px = height_px}, num_along};
}

std::vector<size_t> Around(const ImageCells& cells, int cell) {
  std::vector<size_t> around;
  cells.VisitAround(cell, [&](size_t number) { around.push_back(number); });
  return around;
}

TEST(ImageCells, AreNumberedRowByRow) {
  const ImageCells cells = CellsOf(640, 480, 4);  // of 160 px: 4 x 3
  EXPECT_EQ(cells.num(), 12);
  EXPECT_EQ(cells.Of(0.0, 0.0), 0);
  EXPECT_EQ(cells.Of(159.9, 159.9), 0);
  EXPECT_EQ(cells.Of(160.0, 159.9), 1);
  EXPECT_EQ(cells.Of(639.9, 479.9), 11);
}

TEST(ImageCells, AreTheSameForACameraOnItsSide) {
  const ImageCells lying = CellsOf(1241, 376, 40), upright = CellsOf(376, 1241, 40);
  EXPECT_EQ(lying.num(), upright.num());
  EXPECT_EQ(lying.num() % 40, 0);
  EXPECT_EQ(upright.Of(375.0, 1240.0), upright.num() - 1);
}

TEST(ImageCells, APixelBesideTheImageBelongsToTheNearest) {
  const ImageCells cells = CellsOf(640, 480, 4);
  EXPECT_EQ(cells.Of(-3.0, -2.0), 0);
  EXPECT_EQ(cells.Of(700.0, 100.0), 3);
  EXPECT_EQ(cells.Of(700.0, 500.0), 11);
}

TEST(ImageCells, NeighborsStopAtTheEdge) {
  const ImageCells cells = CellsOf(640, 480, 4);
  EXPECT_THAT(Around(cells, 0), ElementsAre(0, 1, 4, 5));
  EXPECT_THAT(Around(cells, 6), ElementsAre(1, 2, 3, 5, 6, 7, 9, 10, 11));
  EXPECT_THAT(Around(cells, 11), ElementsAre(6, 7, 10, 11));
}

TEST(ImageCells, AreNeverSmallerThanAPixel) {
  EXPECT_EQ(CellsOf(1, 1, 40).num(), 1);
  EXPECT_EQ(CellsOf(3, 2, 40).num(), 6);
}

TEST(ImageCells, OfNoImageThereAreNone) { EXPECT_TRUE(ImageCells().empty()); }

}  // namespace
}  // namespace tessera
