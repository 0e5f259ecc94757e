"""A trajectory over its truth as text for terminals."""

import numpy as np

from tessera_cli.report.trajectory_plot import widest_axes
from tessera_cli.runs.dot_picture import BLANK, dots_of
from tessera_cli.runs.run_folder import Result

BLUE, GRAY, PLAIN = "\x1b[94m", "\x1b[90m", "\x1b[0m"


def draw_from_above(result: Result, columns: int, lines: int, colored: bool) -> str:
    """The path from above to scale, the truth in gray below the estimate.

    Characters that hold both take the estimate's color. The result must have an estimate.
    """
    reference = result.reference_path()
    axes = list(widest_axes(reference))
    paths = [reference[:, axes], result.path()[:, axes]] if result.error else [reference[:, axes]]
    pictures = dots_of(paths, columns, lines)
    return "\n".join(_line(pictures, row, colored) for row in reversed(range(len(pictures[0]))))


def _line(pictures: list[np.ndarray], row: int, colored: bool) -> str:
    estimate, together = pictures[-1][row], np.bitwise_or.reduce([picture[row] for picture in pictures])
    characters = [chr(BLANK + bits) for bits in together]
    if colored:
        characters = [
            f"{BLUE if is_estimate else GRAY}{character}{PLAIN}" if character != chr(BLANK) else character
            for character, is_estimate in zip(characters, estimate)
        ]
    return "".join(characters)
