"""How the occupancy map of a run looks: its voxels, and its grid under the path of the camera."""

from collections.abc import Iterator

import numpy as np

from tessera_cli.maps import occupancy_file
from tessera_cli.maps.colors import voxel_colors
from tessera_cli.runs.run_folder import Result
from tessera_cli.viewing.scene import FLOOR, VOXELS, Floor, Shown, Voxels

# Of the points above the grid: strays are fewer.
LOWEST = 0.01


def occupancy_of(result: Result) -> Iterator[Shown]:
    """Nothing where the run had no occupancy stage."""
    below = result.estimate.positions if result.estimate is not None else np.empty((0, 3))
    if result.voxel_tree is not None:
        voxels = occupancy_file.read_voxels(result.voxel_tree)
        yield Voxels(VOXELS, voxels.centers, voxels.sizes, voxel_colors(voxels))
        below = np.concatenate([below, voxels.centers])
    if result.grid is not None and len(below):
        yield floor_of(result.grid, below)


def floor_of(grid: occupancy_file.Grid, points: np.ndarray) -> Floor:
    """Below all but the lowest of n x 3 points, which it would hide; a grid has no height itself."""
    x, y, up = grid.axes
    height = float(np.quantile(points @ up, LOWEST))
    rows = grid.image.shape[0]
    left, top = grid.origin[0] + grid.resolution / 2, grid.origin[1] + (rows - 0.5) * grid.resolution
    corner = left * x + top * y + height * up
    return Floor(FLOOR, grid.image, corner, grid.resolution * x, -grid.resolution * y)
