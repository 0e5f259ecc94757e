"""What the figures of a report have in common: sizes, colours and marks. Colours are the stand-ins of svg.py."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tessera_cli.report.svg import BAD, NUM_SERIES, SERIES
from tessera_cli.runs.run_folder import Result

# Units in which texts are 11 and 12 high: a card is about as wide as a phone.
CARD = (380, 285)
DASHES = ("-", (0, (5, 2)), (0, (1, 1.5)))
MAX_NAME = 26
MAX_POINTS = 1500  # of a curve: more than a screen has columns
PIPELINE = ("camera", "dispatcher", "extractor", "reassembler", "tracker", "mapper")


@dataclass(frozen=True)
class Drawing:
    title: str
    label: str  # what it shows, in words, for who can't see it
    note: str  # how to read it
    svg: str
    svg_phone: str = ""  # another drawing for narrow screens, where one size does not serve all
    is_hero: bool = False


def short(name: str) -> str:
    return name if len(name) <= MAX_NAME else f"{name[: MAX_NAME // 2]}…{name[-(MAX_NAME // 2 - 1) :]}"


def color_of(index: int) -> str:
    return SERIES[index % NUM_SERIES]


def dashes_of(index: int):
    return DASHES[index // NUM_SERIES % len(DASHES)]


def width_of(index: int, number: int) -> float:
    """Of the index-th line of several: thinner ones lie on wider ones, so that equal ones are all seen."""
    return 1.5 if number < 2 else 1.3 + 2.4 * (number - 1 - index) / (number - 1)


def thin(*columns: np.ndarray) -> list[np.ndarray]:
    """Every k-th row, and the last."""
    step = max(1, len(columns[0]) // MAX_POINTS)
    return [np.concatenate([column[::step], column[-1:]]) for column in columns]


def add_legend(figure: Figure, columns: int) -> None:
    figure.legend(loc="outside upper left", ncols=columns, handlelength=1.6, columnspacing=1.2, borderpad=0.1)


def mark_loops(axes: Axes, numbered: list[tuple[int, Result]]) -> None:
    """Upright lines where a loop was closed."""
    label = "loop closed"
    for _, result in numbered:
        for loop in result.loops:
            axes.axvline(loop.keyframe_s - start_s(result), color=BAD, linewidth=1, linestyle=(0, (2, 2)), label=label)
            label = None


def start_s(result: Result) -> float:
    if result.frames is not None:
        return float(result.frames.times_s[0])
    return float(result.estimate.timestamps_s[0]) if result.estimate else 0.0


def numbered_where(results: list[Result], has: Callable[[Result], bool]) -> list[tuple[int, Result]]:
    """Those that have it, with the numbers that give them their colours."""
    return [(index, result) for index, result in enumerate(results) if has(result)]


def in_order(processes: list[str]) -> list[str]:
    """As the data flow; those beside the pipeline at the end."""

    def place(name: str) -> tuple[int, str]:
        places = [index for index, stage in enumerate(PIPELINE) if name.startswith(stage)]
        return (places[0] if places else len(PIPELINE), name)

    return sorted(processes, key=place)
