"""How the occupancy map of a run looks: its voxels, and its grid under the path of the camera."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tessera_cli.maps.occupancy_file import Grid, read_voxels
from tessera_cli.runs.run_folder import Result
from tessera_cli.viewing.map_shapes import height_colors
from tessera_cli.viewing.scene import FLOOR, VOXELS, Floor, Shown, Voxels


def occupancy_of(folder: Path, result: Result) -> Iterator[Shown]:
    """Nothing where the run had no occupancy stage."""
    if result.grid is not None and result.estimate is not None:
        yield floor_of(result.grid, result.estimate.positions)
    if (folder / "occupancy.bt").is_file():
        voxels = read_voxels(folder / "occupancy.bt")
        yield Voxels(VOXELS, voxels.centers, voxels.sizes, height_colors(voxels.centers))


def floor_of(grid: Grid, path: np.ndarray) -> Floor:
    """At the lowest height of the path (n x 3), since a grid has none itself."""
    x, y, up = grid.axes
    height = float((path @ up).min())
    rows = grid.image.shape[0]
    left, top = grid.origin[0] + grid.resolution / 2, grid.origin[1] + (rows - 0.5) * grid.resolution
    corner = left * x + top * y + height * up
    return Floor(FLOOR, grid.image, corner, grid.resolution * x, -grid.resolution * y)
