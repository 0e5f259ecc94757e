"""Lines as text for terminals: each character holds 2 x 4 dots (Unicode Braille)."""

import numpy as np

DOTS_ACROSS, DOTS_UP = 2, 4
BLANK = 0x2800
# Bit of the dot in row r (from the top) and column c of a character.
BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
DOTS_PER_STEP = 2  # dots are set this densely along a line, so that it has no gaps


def dots_of(paths: list[np.ndarray], columns: int, lines: int) -> list[np.ndarray]:
    """For each path (N x 2, right and up) the bits of its characters, rows from the bottom, all to one scale.

    The pictures have one size, within `columns` x `lines`. There must be at least one point.
    """
    low = np.min([path.min(axis=0) for path in paths], axis=0)
    high = np.max([path.max(axis=0) for path in paths], axis=0)
    room = np.array([columns * DOTS_ACROSS - 1, lines * DOTS_UP - 1])
    dots_per_m = np.min(room / np.maximum(high - low, 1e-9))
    size = np.floor((high - low) * dots_per_m / [DOTS_ACROSS, DOTS_UP]).astype(int) + 1
    return [_bits(_dense((path - low) * dots_per_m), size) for path in paths]


def text_of(bits: np.ndarray) -> str:
    """A picture as lines, the top one first."""
    return "\n".join("".join(chr(BLANK + each) for each in row) for row in bits[::-1])


def _dense(points: np.ndarray) -> np.ndarray:
    """Points along the polyline in whole dots, closer together than the dots."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    positions = np.linspace(0.0, along[-1], int(DOTS_PER_STEP * along[-1]) + 2)
    return np.column_stack([np.interp(positions, along, points[:, axis]) for axis in (0, 1)]).astype(int)


def _bits(dots: np.ndarray, size: np.ndarray) -> np.ndarray:
    bits = np.zeros((size[1], size[0]), dtype=int)
    for x, y in dots:
        bits[y // DOTS_UP, x // DOTS_ACROSS] |= BITS[DOTS_UP - 1 - y % DOTS_UP][x % DOTS_ACROSS]
    return bits
