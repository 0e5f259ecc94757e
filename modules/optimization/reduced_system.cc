#include "optimization/reduced_system.h"

#include <amd.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <stdexcept>

#include "core/ids.h"

namespace tessera {
namespace {

constexpr int kSize = 6;  // of a block

class DenseSystem final : public ReducedSystem {
 public:
  explicit DenseSystem(int num_poses)
      : num_poses_(num_poses), blocks_(static_cast<size_t>(num_poses * (num_poses + 1) / 2), Block::Zero()) {}

  void Clear() override { std::fill(blocks_.begin(), blocks_.end(), Block::Zero()); }
  Block& At(int row, int column) override { return blocks_[static_cast<size_t>(row * (row + 1) / 2 + column)]; }

  bool Solve(std::span<Vector> vectors) override {
    Eigen::MatrixXd matrix(kSize * num_poses_, kSize * num_poses_);
    for (int row = 0; row < num_poses_; ++row) {
      for (int column = 0; column <= row; ++column) {
        matrix.block<kSize, kSize>(kSize * row, kSize * column) = At(row, column);
      }
    }
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factors(matrix);  // in place, the lower triangle
    if (factors.info() != Eigen::Success) return false;
    Eigen::Map<Eigen::VectorXd> solution(vectors.front().data(), kSize * num_poses_);
    factors.solveInPlace(solution);
    return true;
  }

 private:
  const int num_poses_;
  std::vector<Block> blocks_;  // lower triangle, row by row
};

}  // namespace

std::unique_ptr<ReducedSystem> MakeDenseSystem(int num_poses) { return std::make_unique<DenseSystem>(num_poses); }

namespace {

// A list of rows for each column, one behind the other.
struct Columns {
  std::vector<int> first{0};  // by column: of its rows; one more at the end
  std::vector<int> rows;

  size_t begin(int column) const { return Index(first[Index(column)]); }
  size_t end(int column) const { return Index(first[Index(column) + 1]); }
  void Finish() { first.push_back(static_cast<int>(rows.size())); }
};

// Of the lower triangle, columns and rows in order.
Columns ColumnsOf(int num_columns, std::vector<ReducedSystem::Place> places) {
  std::ranges::sort(places, {}, [](const ReducedSystem::Place& p) { return std::pair(p.column, p.row); });
  Columns columns;
  auto place = places.begin();
  for (int column = 0; column < num_columns; ++column) {
    for (; place != places.end() && place->column == column; ++place) columns.rows.push_back(place->row);
    columns.Finish();
  }
  return columns;
}

// By position: which pose is eliminated there.
std::vector<int> MinimumDegreeOrder(int num_poses, const std::vector<ReducedSystem::Place>& places) {
  std::vector<ReducedSystem::Place> both;
  for (const ReducedSystem::Place& place : places) {
    if (place.row == place.column) continue;
    both.push_back(place);
    both.push_back({place.column, place.row});
  }
  const Columns graph = ColumnsOf(num_poses, std::move(both));
  std::vector<int> order(Index(num_poses));
  if (amd_order(num_poses, graph.first.data(), graph.rows.data(), order.data(), nullptr, nullptr) != AMD_OK) {
    throw std::runtime_error("the order of elimination can't be found: out of memory");
  }
  return order;
}

// Of the factor L, without its diagonal: a column has the rows of the matrix, and those of every column before whose
// first row it is (its children in the elimination tree).
Columns FactorColumns(int num_columns, const Columns& matrix) {
  Columns factor;
  std::vector<std::vector<int>> children(Index(num_columns));
  for (int column = 0; column < num_columns; ++column) {
    std::vector<int> rows(matrix.rows.begin() + static_cast<ptrdiff_t>(matrix.begin(column)),
                          matrix.rows.begin() + static_cast<ptrdiff_t>(matrix.end(column)));
    for (const int child : children[Index(column)]) {
      rows.insert(rows.end(), factor.rows.begin() + static_cast<ptrdiff_t>(factor.begin(child)),
                  factor.rows.begin() + static_cast<ptrdiff_t>(factor.end(child)));
    }
    std::ranges::sort(rows);
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    std::erase(rows, column);
    if (!rows.empty()) children[Index(rows.front())].push_back(column);
    factor.rows.insert(factor.rows.end(), rows.begin(), rows.end());
    factor.Finish();
  }
  return factor;
}

class SparseSystem final : public ReducedSystem {
 public:
  SparseSystem(int num_poses, const std::vector<Place>& places)
      : num_poses_(num_poses), matrix_(ColumnsOf(num_poses, places)), position_(Index(num_poses)) {
    const std::vector<int> order = MinimumDegreeOrder(num_poses, places);
    for (int i = 0; i < num_poses; ++i) position_[Index(order[Index(i)])] = i;
    std::vector<Place> permuted;
    for (const Place& place : places) {
      const auto [column, row] = std::minmax(position_[Index(place.row)], position_[Index(place.column)]);
      permuted.push_back({row, column});
    }
    factor_ = FactorColumns(num_poses, ColumnsOf(num_poses, std::move(permuted)));
    blocks_.resize(places.size());
    lower_.resize(factor_.rows.size());
    diagonal_.resize(Index(num_poses));
  }

  void Clear() override { std::fill(blocks_.begin(), blocks_.end(), Block::Zero()); }

  Block& At(int row, int column) override { return blocks_[Find(matrix_, row, column)]; }

  bool Solve(std::span<Vector> vectors) override {
    Permute();
    if (!Factorize()) return false;
    std::vector<Vector> solution(vectors.size());
    for (size_t i = 0; i < vectors.size(); ++i) solution[Index(position_[i])] = vectors[i];
    Substitute(solution);
    for (size_t i = 0; i < vectors.size(); ++i) vectors[i] = solution[Index(position_[i])];
    return true;
  }

 private:
  static size_t Find(const Columns& columns, int row, int column) {
    const auto begin = columns.rows.begin();
    const auto found = std::lower_bound(begin + static_cast<ptrdiff_t>(columns.begin(column)),
                                        begin + static_cast<ptrdiff_t>(columns.end(column)), row);
    return static_cast<size_t>(found - begin);
  }

  void Permute() {
    std::fill(lower_.begin(), lower_.end(), Block::Zero());
    for (int column = 0; column < num_poses_; ++column) {
      for (size_t k = matrix_.begin(column); k < matrix_.end(column); ++k) {
        const int a = position_[Index(matrix_.rows[k])], b = position_[Index(column)];
        if (a == b) {
          diagonal_[Index(a)] = blocks_[k];
        } else if (a > b) {
          lower_[Find(factor_, a, b)] = blocks_[k];
        } else {
          lower_[Find(factor_, b, a)] = blocks_[k].transpose();
        }
      }
    }
  }

  // A = L L', column after column; each one is then taken from what is left.
  bool Factorize() {
    for (int column = 0; column < num_poses_; ++column) {
      Block& diagonal = diagonal_[Index(column)];
      const Eigen::LLT<Block> factor(diagonal);
      if (factor.info() != Eigen::Success) return false;
      diagonal = factor.matrixL();
      const size_t begin = factor_.begin(column), end = factor_.end(column);
      for (size_t k = begin; k < end; ++k) {
        factor.matrixU().solveInPlace<Eigen::OnTheRight>(lower_[k]);
      }
      for (size_t k = begin; k < end; ++k) {
        const int other = factor_.rows[k];
        diagonal_[Index(other)].noalias() -= lower_[k].lazyProduct(lower_[k].transpose());
        size_t target = factor_.begin(other);
        for (size_t l = k + 1; l < end; ++l) {
          while (factor_.rows[target] != factor_.rows[l]) ++target;
          lower_[target].noalias() -= lower_[l].lazyProduct(lower_[k].transpose());
        }
      }
    }
    return true;
  }

  void Substitute(std::vector<Vector>& x) const {
    for (int column = 0; column < num_poses_; ++column) {
      Vector& own = x[Index(column)];
      diagonal_[Index(column)].triangularView<Eigen::Lower>().solveInPlace(own);
      for (size_t k = factor_.begin(column); k < factor_.end(column); ++k) {
        x[Index(factor_.rows[k])].noalias() -= lower_[k].lazyProduct(own);
      }
    }
    for (int column = num_poses_ - 1; column >= 0; --column) {
      Vector& own = x[Index(column)];
      for (size_t k = factor_.begin(column); k < factor_.end(column); ++k) {
        own.noalias() -= lower_[k].transpose().lazyProduct(x[Index(factor_.rows[k])]);
      }
      diagonal_[Index(column)].transpose().triangularView<Eigen::Upper>().solveInPlace(own);
    }
  }

  const int num_poses_;
  const Columns matrix_;       // by pose
  std::vector<Block> blocks_;  // of it
  std::vector<int> position_;  // by pose: in the order of elimination
  Columns factor_;             // by position, without the diagonal
  std::vector<Block> lower_;   // of it
  std::vector<Block> diagonal_;
};

}  // namespace

std::unique_ptr<ReducedSystem> MakeSparseSystem(int num_poses, const std::vector<ReducedSystem::Place>& places) {
  return std::make_unique<SparseSystem>(num_poses, places);
}

}  // namespace tessera
