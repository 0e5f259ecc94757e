"""What the figures of a report have in common: sizes, colors and marks. Colors are the placeholders of svg.py."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tessera_cli.report.svg import BAD, NUM_SERIES, SERIES
from tessera_cli.runs.run_folder import Result

# Units in which texts are 11 and 12 high: a card is about as wide as a phone.
CARD = (380, 285)
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1.5)))
MAX_NAME_LENGTH = 26
MAX_POINTS = 1500  # of a curve: more than a screen has columns
PIPELINE = ("camera", "dispatcher", "extractor", "reassembler", "tracker", "mapper")


@dataclass(frozen=True)
class Drawing:
    """One figure of a report."""

    title: str
    label: str  # what it shows, in words, for people who can't see it
    note: str  # how to read it
    svg: str
    svg_phone: str = ""  # another drawing for narrow screens, where one size is not enough
    is_hero: bool = False  # drawn large


def short(name: str) -> str:
    half = MAX_NAME_LENGTH // 2
    return name if len(name) <= MAX_NAME_LENGTH else f"{name[:half]}…{name[-(half - 1) :]}"


def color_of(index: int) -> str:
    return SERIES[index % NUM_SERIES]


def dashes_of(index: int) -> Any:
    return DASHES[index // NUM_SERIES % len(DASHES)]


def width_of(index: int, number: int) -> float:
    """Of the index-th line of several: narrower ones lie on wider ones, so that equal ones are all seen."""
    return 1.5 if number < 2 else 1.3 + 2.4 * (number - 1 - index) / (number - 1)


def thin(*columns: np.ndarray) -> list[np.ndarray]:
    """Every k-th row, and the last."""
    step = max(1, len(columns[0]) // MAX_POINTS)
    return [np.concatenate([column[::step], column[-1:]]) for column in columns]


def add_legend(figure: Figure, columns: int) -> None:
    figure.legend(loc="outside upper left", ncols=columns, handlelength=1.6, columnspacing=1.2, borderpad=0.1)


def mark_loops(axes: Axes, numbered: list[tuple[int, Result]]) -> None:
    """Upright lines where a loop was closed."""
    label: str | None = "loop closed"
    for _, result in numbered:
        for loop in result.loops:
            at = loop.keyframe_s - start_s(result)
            axes.axvline(at, color=BAD, linewidth=1, linestyle=(0, (2, 2)), label=label)
            label = None


def start_s(result: Result) -> float:
    """Time of the first frame in the source."""
    if result.frames is not None:
        return float(result.frames.times_s[0])
    return float(result.estimate.timestamps_s[0]) if result.estimate else 0.0


def numbered_where(results: list[Result], condition: Callable[[Result], bool]) -> list[tuple[int, Result]]:
    """The results that fulfill it, with the numbers that determine their colors."""
    return [(index, result) for index, result in enumerate(results) if condition(result)]


def in_order(processes: Iterable[str]) -> list[str]:
    """As the data flow; those beside the pipeline at the end."""

    def position(name: str) -> tuple[int, str]:
        positions = [index for index, stage in enumerate(PIPELINE) if name.startswith(stage)]
        return (positions[0] if positions else len(PIPELINE), name)

    return sorted(processes, key=position)
