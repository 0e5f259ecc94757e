"""Figures of where the camera went: from above, from the side, and how far from the truth."""

import numpy as np
from matplotlib.axes import Axes

from tessera_cli.report.drawing import (
    CARD,
    Drawing,
    add_legend,
    color_of,
    dashes_of,
    mark_loops,
    numbered_where,
    short,
    start_s,
    thin,
    width_of,
)
from tessera_cli.report.svg import BAD, INK, NUM_SERIES, TRUTH, new_figure, to_svg
from tessera_cli.report.trajectory_plot import AXES, widest_axes
from tessera_cli.runs.run_folder import Result, positions_at

HERO = (820, 660)  # of the one that is drawn large where there is room
PHONE_HERO = (380, 400)


def draw_ways(results: list[Result]) -> list[Drawing]:
    """From above and from the side, for each ground truth."""
    groups = _same_truth(results)
    drawings = []
    for number, group in enumerate(groups):
        # Several plots are told apart by the names of what they show; one alone may be large.
        names = f": {_names(group)}" if len(groups) > 1 else ""
        drawings.append(_from_above(group, f"above-{number}", names, is_hero=len(groups) == 1))
        drawings.append(_from_side(group, f"side-{number}", names))
    return drawings


def _same_truth(results: list[Result]) -> list[list[tuple[int, Result]]]:
    """Results that have a trajectory, those of one ground truth together: they go into one plot."""
    groups: dict[bytes, list[tuple[int, Result]]] = {}
    for index, result in numbered_where(results, lambda result: result.estimate is not None):
        # Without a truth each map has a frame of its own.
        key = result.truth.positions.tobytes() if result.error else f"{index}".encode()
        groups.setdefault(key, []).append((index, result))
    return list(groups.values())


def _reference(group: list[tuple[int, Result]]) -> np.ndarray:
    """What the axes are chosen by."""
    result = group[0][1]
    return result.truth.positions if result.error else result.estimate.positions


def _names(group: list[tuple[int, Result]]) -> str:
    return ", ".join(result.name for _, result in group)


def _draw_ways(axes: Axes, group: list[tuple[int, Result]], across: int, along: int) -> None:
    first = group[0][1]
    if first.error:
        axes.plot(
            *thin(first.truth.positions[:, across], first.truth.positions[:, along]),
            color=TRUTH,
            linewidth=4.5,
            label="ground truth",
            solid_capstyle="round",
        )
    for place, (index, result) in enumerate(group):
        if len(group) == 1 and result.live is not None:
            live = result.in_truth(result.live.positions)
            axes.plot(
                *thin(live[:, across], live[:, along]),
                color=color_of(NUM_SERIES - 1),
                linewidth=1,
                linestyle=(0, (4, 2)),
                label="as published at the time",
            )
        positions = result.in_truth(result.estimate.positions)
        axes.plot(
            *thin(positions[:, across], positions[:, along]),
            color=color_of(index),
            linestyle=dashes_of(index),
            linewidth=width_of(place, len(group)),
            label="estimate" if len(group) == 1 else short(result.name),
        )
    _draw_loops(axes, group, across, along)
    axes.plot(*_reference(group)[0, [across, along]], "o", color=INK, markersize=6, label="start")


def _draw_loops(axes: Axes, group: list[tuple[int, Result]], across: int, along: int) -> None:
    label = "loop closed"
    for _, result in group:
        for loop in result.loops:
            ends = result.in_truth(positions_at(result.estimate, [loop.keyframe_s, loop.matched_s]))
            axes.plot(
                ends[:, across],
                ends[:, along],
                color=BAD,
                marker="o",
                markersize=6,
                markerfacecolor="none",
                markeredgewidth=1.4,
                linewidth=1.4,
                linestyle="-",
                label=label,
            )
            label = None


def _from_above(group: list[tuple[int, Result]], key: str, names: str, is_hero: bool) -> Drawing:
    across, along = widest_axes(_reference(group))
    unit = group[0][1].unit

    def draw(size: tuple[int, int], name: str, columns: int) -> str:
        figure = new_figure(*size)
        axes = figure.subplots()
        _draw_ways(axes, group, across, along)
        axes.set(xlabel=f"{AXES[across]} [{unit}]", ylabel=f"{AXES[along]} [{unit}]")
        axes.set_aspect("equal", adjustable="datalim")
        add_legend(figure, columns)
        return to_svg(figure, name, label)

    label = _label_of_ways(group, f"seen from above, {AXES[across]} and {AXES[along]}")
    has_live = len(group) == 1 and group[0][1].live is not None
    note = "The two axes along which the way is longest, drawn to scale."
    if has_live:
        note += " The solid line is the way after all optimisation, the dashed one as it was published frame by frame."
    if any(result.loops for _, result in group):
        note += " Circles mark keyframes that saw a known place again, a line between them leads to the one they were matched with."
    title, small = f"The way from above{names}", draw(PHONE_HERO, f"{key}-small", 2)
    return (
        Drawing(title, label, note, draw(HERO, key, 5), small, is_hero=True)
        if is_hero
        else Drawing(title, label, note, small)
    )


def _from_side(group: list[tuple[int, Result]], key: str, names: str) -> Drawing:
    across, along = widest_axes(_reference(group))
    upright = 3 - across - along
    unit = group[0][1].unit
    figure = new_figure(*(CARD if names == "" else PHONE_HERO))
    axes = figure.subplots()
    _draw_ways(axes, group, across, upright)
    if upright == 1:
        axes.invert_yaxis()  # a camera's y axis points down
    axes.set(xlabel=f"{AXES[across]} [{unit}]", ylabel=f"{AXES[upright]} [{unit}]")
    label = _label_of_ways(group, f"seen from the side, {AXES[across]} and {AXES[upright]}")
    return Drawing(
        f"The way from the side{names}",
        label,
        "The third axis against the longest; the two have different scales.",
        to_svg(figure, key, label),
    )


def _label_of_ways(group: list[tuple[int, Result]], view: str) -> str:
    errors = [f"{result.name} {result.error.rms_m:.3f} m" for _, result in group if result.error]
    num_loops = sum(len(result.loops) for _, result in group)
    words = f"Trajectory {view}: {_names(group)}"
    words += f" over the ground truth; RMS distance {', '.join(errors)}" if errors else ", without a ground truth"
    return words + (f"; {num_loops} closed {'loop' if num_loops == 1 else 'loops'} drawn in." if num_loops else ".")


def draw_errors(results: list[Result]) -> Drawing | None:
    numbered = numbered_where(results, lambda result: result.error is not None)
    if not numbered:
        return None
    figure = new_figure(*CARD)
    axes = figure.subplots()
    has_times = all(result.truth.has_times for _, result in numbered)
    for place, (index, result) in enumerate(numbered):
        error = result.error
        seconds = error.timestamps_s - (start_s(result) if has_times else 0.0)
        axes.plot(
            *thin(seconds, error.errors_m),
            color=color_of(index),
            linestyle=dashes_of(index),
            linewidth=width_of(place, len(numbered)),
            label="error" if len(results) == 1 else short(result.name),
        )
        if len(results) == 1:
            axes.axhline(error.rms_m, color=INK, linestyle="--", linewidth=1, label=f"RMS {error.rms_m:.3f} m")
    if has_times:
        mark_loops(axes, numbered)
    axes.set(xlabel="time [s]" if has_times else "frame", ylabel="error [m]", ylim=(0, None))
    add_legend(figure, 3 if len(results) == 1 else 2)
    worst = "; ".join(
        f"{result.name}: RMS {result.error.rms_m:.3f} m, at most {result.error.errors_m.max():.3f} m"
        for _, result in numbered
    )
    label = f"Distance between estimated and true position along the way. {worst}."
    return Drawing(
        "Error along the way",
        label,
        "Distance from the true position, after the alignment of the whole way.",
        to_svg(figure, "errors", label),
    )
