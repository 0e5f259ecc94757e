"""The occupancy grid of a run under its path: what stands around the camera's way, seen from above."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.transforms import Affine2D

from tessera_cli.maps.occupancy_file import UNKNOWN_GRAY, Grid
from tessera_cli.runs.run_folder import Result

# Gray is seen on light and on dark pages; what is unknown is left out.
GRAY, OCCUPIED_ALPHA, FREE_ALPHA = 128, 235, 45
OCCUPIED_BELOW = 128  # of the image's gray values
# How much of a cell's area a plot must show: from the side there is nothing to see.
MIN_SHOWN_AREA = 0.8


def draw_grid(axes: Axes, result: Result, across: int, along: int) -> None:
    """Nothing where the run has no grid, or the plot does not look down on it. Leaves the limits of the axes alone."""
    grid = result.grid
    if grid is None:
        return
    placed = _in_plot(grid, result)
    normal = np.cross(placed[1], placed[2])
    if abs(normal[3 - across - along]) < MIN_SHOWN_AREA * np.linalg.norm(normal):
        return
    corner, right, up = placed[:, [across, along]]
    rows, columns = grid.image.shape
    # Pixel (column, row) of the image, whose rows begin with the highest y, in the plot.
    matrix = np.array([[right[0], -up[0], corner[0]], [right[1], -up[1], corner[1]], [0, 0, 1]])
    # Not by imshow(), which would fit the axes to the image.
    image = AxesImage(axes, extent=(0, columns, rows, 0), interpolation="none", zorder=0)
    image.set_data(to_rgba(grid.image))
    image.set_transform(Affine2D(matrix) + axes.transData)
    image.set_clip_path(axes.patch)
    image.set_in_layout(False)
    axes.add_image(image)


def to_rgba(image: np.ndarray) -> np.ndarray:
    """Rows x columns x 4 bytes."""
    alpha = np.where(image < OCCUPIED_BELOW, OCCUPIED_ALPHA, np.where(image == UNKNOWN_GRAY, 0, FREE_ALPHA))
    return np.dstack([np.full((*image.shape, 3), GRAY), alpha]).astype(np.uint8)


def _in_plot(grid: Grid, result: Result) -> np.ndarray:
    """3 x 3: the image's upper left corner, and the way from one column and from one row (upward) to the next.

    In the world of the plot: that of the truth, where there is one.
    """
    corner = np.array([grid.origin[0], grid.origin[1] + grid.resolution * grid.image.shape[0]])
    steps = grid.resolution * grid.axes[:2]
    ends = np.array([np.zeros(3), corner @ grid.axes[:2], *steps])
    zero, placed, right, up = result.in_truth(ends)
    return np.array([placed, right - zero, up - zero])
