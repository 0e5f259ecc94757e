"""The occupancy grid lies under the path of a report where it stands in the world."""

import re
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from helpers.made_run import true_position, write_run
from helpers.page import Page
from tessera_cli.report.grid_underlay import draw_grid, to_rgba
from tessera_cli.report.html_report import write_report
from tessera_cli.runs.run_folder import read_run

RESOLUTION_M = 0.5


def write_grid(folder: Path, shift_m: float = 0.0) -> None:
    """Cells of 0.5 m over x -25..25, z -5..65; those within 1 m of the way are free, one at (12, 40) is occupied."""
    x = np.arange(-25, 25, RESOLUTION_M) + RESOLUTION_M / 2
    z = np.arange(-5, 65, RESOLUTION_M) + RESOLUTION_M / 2
    way = np.array([true_position(frame)[[0, 2]] for frame in range(110)])
    centers = np.stack(np.meshgrid(x, z), axis=2)
    near = np.linalg.norm(centers[:, :, None] - way, axis=3).min(axis=2) < 1
    image = np.where(near, 254, 205).astype(np.uint8)
    image[int((40 + 5) / RESOLUTION_M), int((12 + 25) / RESOLUTION_M)] = 0
    rows, columns = image.shape
    (folder / "occupancy.pgm").write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + image[::-1].tobytes())
    (folder / "occupancy.yaml").write_text(
        "# The grid's plane: x axis [1, 0, 0], y axis [0, 0, 1], up [0, -1, 0]\n"
        f"image: occupancy.pgm\nmode: trinary\nresolution: {RESOLUTION_M}\norigin: [{-25 + shift_m}, -5.0, 0.0]\n"
    )


def occupied_in_plot(folder: Path) -> np.ndarray:
    """Where the plot from above shows the center of the occupied cell."""
    axes = Figure().subplots()
    axes.set(xlim=(-30, 30), ylim=(-10, 70))
    result = read_run(folder)
    draw_grid(axes, result, 0, 2)
    (image,) = axes.get_images()
    assert result.grid is not None
    ((row, column),) = np.argwhere(result.grid.image == 0)
    to_plot = image.get_transform() - axes.transData
    return to_plot.transform([column + 0.5, row + 0.5])


def test_cells_are_where_they_stand(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", truth=False)
    write_grid(folder)
    assert np.allclose(occupied_in_plot(folder), [12.25, 40.25])
    write_grid(folder, shift_m=3.0)
    assert np.allclose(occupied_in_plot(folder), [15.25, 40.25])


def test_the_grid_is_aligned_to_the_truth_as_the_path_is(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", sensor="mono")
    rows = (folder / "trajectory.txt").read_text().splitlines()
    moved = [row.split() for row in rows[1:]]
    turned = [[time, z, y, str(-float(x)), *rest] for time, x, y, z, *rest in moved]
    (folder / "trajectory.txt").write_text("\n".join(" ".join(row) for row in turned) + "\n")
    write_grid(folder)
    # The estimate's x is the truth's z, and its z the truth's -x.
    assert np.allclose(occupied_in_plot(folder), [-40.25, 12.25], atol=0.3)


def test_from_the_side_there_is_nothing_to_see(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    write_grid(folder)
    axes = Figure().subplots()
    draw_grid(axes, read_run(folder), 0, 1)
    assert not axes.get_images()


def test_what_is_unknown_is_left_out() -> None:
    alpha = to_rgba(np.array([[0, 205, 254]], np.uint8))[0, :, 3]
    assert alpha[1] == 0 < alpha[2] < alpha[0]


def test_the_report_shows_it(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    write_grid(folder)
    write_report([read_run(folder)], tmp_path / "report.html")
    page = Page(tmp_path / "report.html")
    assert "occupancy grid" in page.root.words()
    images = re.findall(r'href="data:image/png;base64,[^"]*"', page.source)
    assert images and not any("-" in image.split(",")[1] for image in images), "an image is no id"
