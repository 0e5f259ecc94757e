"""A trajectory over its truth as text for terminals: each character holds 2 x 4 dots (Unicode Braille)."""

import numpy as np

from tessera_cli.report.trajectory_plot import widest_axes
from tessera_cli.runs.run_folder import Result

DOTS_ACROSS, DOTS_UP = 2, 4
BLANK = 0x2800
# Bit of the dot in row r (from the top) and column c of a character.
BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
BLUE, GRAY, PLAIN = "\x1b[94m", "\x1b[90m", "\x1b[0m"
DOTS_PER_STEP = 2  # dots are set this densely along a line, so that it has no gaps


def draw_from_above(result: Result, columns: int, lines: int, colored: bool) -> str:
    """The path from above to scale, the truth in gray below the estimate.

    Characters that hold both take the estimate's color. The result must have an estimate.
    """
    reference = result.reference_path()
    axes = list(widest_axes(reference))
    paths = [reference[:, axes], result.path()[:, axes]] if result.error else [reference[:, axes]]
    low = np.min([path.min(axis=0) for path in paths], axis=0)
    high = np.max([path.max(axis=0) for path in paths], axis=0)
    room = np.array([columns * DOTS_ACROSS - 1, lines * DOTS_UP - 1])
    dots_per_m = np.min(room / np.maximum(high - low, 1e-9))
    size = np.floor((high - low) * dots_per_m / [DOTS_ACROSS, DOTS_UP]).astype(int) + 1
    pictures = [_dots(_dense((path - low) * dots_per_m), size) for path in paths]
    return "\n".join(_line(pictures, row, colored) for row in reversed(range(size[1])))


def _dense(points: np.ndarray) -> np.ndarray:
    """Points along the polyline in whole dots, closer together than the dots."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    positions = np.linspace(0.0, along[-1], int(DOTS_PER_STEP * along[-1]) + 2)
    return np.column_stack([np.interp(positions, along, points[:, axis]) for axis in (0, 1)]).astype(int)


def _dots(dots: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Bits of each character, rows from the bottom."""
    bits = np.zeros((size[1], size[0]), dtype=int)
    for x, y in dots:
        bits[y // DOTS_UP, x // DOTS_ACROSS] |= BITS[DOTS_UP - 1 - y % DOTS_UP][x % DOTS_ACROSS]
    return bits


def _line(pictures: list[np.ndarray], row: int, colored: bool) -> str:
    estimate, together = pictures[-1][row], np.bitwise_or.reduce([picture[row] for picture in pictures])
    characters = [chr(BLANK + bits) for bits in together]
    if colored:
        characters = [
            f"{BLUE if is_estimate else GRAY}{character}{PLAIN}" if character != chr(BLANK) else character
            for character, is_estimate in zip(characters, estimate)
        ]
    return "".join(characters)
