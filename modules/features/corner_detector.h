// FAST-9/16 corners (Rosten & Drummond 2006) of a part of a pyramid level.
#pragma once

#include <cstdint>
#include <vector>

#include "features/feature_types.h"
#include "features/pyramid.h"
#include "features/tile_plan.h"

namespace tessera {

class CornerDetector {
 public:
  // Appends the corners of the plan's cells, cell by cell, best first, `capacity` per cell at most. The image,
  // smoothed lightly so that noise makes no corners, must hold 4 px around plan.corners.
  //
  // score(p): the largest threshold t for which p is a corner, i.e. nine neighboring pixels of the ring of 16 are all
  // brighter than p + t, or all darker than p - t.
  //
  // Between the pixels the corner stands where the parabola through the scores of three neighbors of a row or column
  // has its maximum; scores below min_score count as min_score - 1.
  //
  // A corner counts if its score is at least min_score and the highest among its eight neighbors; of equal neighbors
  // the first in reading order counts. Within a cell, a higher score is better, then the first in reading order.
  void Detect(const LevelImage& image, const LevelPlan& plan, int level, int min_score, int capacity,
              std::vector<Candidate>& out);

 private:
  struct Corner {
    int16_t x = 0;
    int16_t y = 0;
    uint8_t score = 0;
    uint8_t left = 0, right = 0, above = 0, below = 0;  // scores of its neighbors
  };

  void ScoreRow(const LevelImage& image, const Rect& corners, int y, int min_score);
  void KeepMaxima(const Rect& corners, int y, int min_score);
  Corner CornerAt(const Rect& corners, int x, int y);
  void Insert(size_t cell, Corner corner);
  uint8_t* ScoreRowAt(int y) { return score_rows_[static_cast<size_t>(y % 3)].data(); }

  int capacity_ = 0;
  std::vector<uint8_t> score_rows_[3];  // scores of three rows; corners.x stands at kRowRoom
  std::vector<Corner> best_;            // capacity_ slots for each cell of one row of cells, best first
  std::vector<int> num_best_;           // how many of them are taken
  std::vector<uint8_t> lowest_;         // a corner must score more than this to enter the cell's list
};

}  // namespace tessera
