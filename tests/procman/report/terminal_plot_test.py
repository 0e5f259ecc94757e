"""Trajectories as characters."""

import numpy as np
import pytest

from tessera_cli.report.terminal_plot import draw_from_above
from tessera_cli.runs.run_folder import Result
from tessera_cli.runs.trajectories import Trajectory, absolute_error


def path_through(corners: list[tuple[float, float]]) -> Trajectory:
    x, z = np.array(corners, dtype=float).T
    positions = np.column_stack([x, np.zeros(len(corners)), z])
    return Trajectory(np.arange(len(corners), dtype=float), positions, np.tile([0.0, 0, 0, 1], (len(corners), 1)), True)


def picture_of(corners: list[tuple[float, float]], columns: int = 20, lines: int = 10) -> list[str]:
    return draw_from_above(Result("path", path_through(corners)), columns, lines, colored=False).splitlines()


def test_a_square_is_closed_and_empty_inside() -> None:
    lines = picture_of([(0, 0), (0, 10), (10, 10), (10, 0), (0, 0)])
    assert len(lines) == 10 and all(len(line) == 20 for line in lines)  # a character is twice as high as wide
    blank = chr(0x2800)
    assert blank not in lines[0] + lines[-1] + "".join(line[0] + line[-1] for line in lines)
    assert all(set(line[1:-1]) == {blank} for line in lines[1:-1])


def test_up_is_up() -> None:
    """An L: its foot is on the last line."""
    lines = picture_of([(0, 10), (0, 0), (6, 0)])
    blank = chr(0x2800)
    assert blank not in lines[-1] and set(lines[0][1:]) == {blank} and lines[0][0] != blank


@pytest.mark.parametrize("columns, lines", [(10, 30), (60, 5), (1, 1)])
def test_it_stays_within_its_room(columns: int, lines: int) -> None:
    picture = picture_of([(0, 0), (3, 7), (11, 2)], columns, lines)
    assert len(picture) <= lines and max(len(line) for line in picture) <= columns


def test_truth_and_estimate_have_colors_of_their_own() -> None:
    truth = path_through([(0, 0), (0, 10), (10, 10), (10, 0)])
    estimate = path_through([(0, 0), (0, 10), (10, 10), (14, 0)])
    result = Result("path", estimate, error=absolute_error(estimate, truth, with_scale=False), truth=truth)
    picture = draw_from_above(result, 30, 12, colored=True)
    assert "\x1b[90m" in picture and "\x1b[94m" in picture
