"""Figures of where the camera went: from above, from the side, and the distance from the truth."""

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
from tessera_cli.report.grid_underlay import draw_grid
from tessera_cli.report.svg import BAD, INK, NUM_SERIES, TRUTH, new_figure, to_svg
from tessera_cli.report.trajectory_plot import AXES, widest_axes
from tessera_cli.runs.run_folder import Result

HERO = (820, 660)  # of the figure that is drawn large where there is room
PHONE_HERO = (380, 400)

Group = list[tuple[int, Result]]  # results of one plot, with the numbers that determine their colors


def draw_paths(results: list[Result]) -> list[Drawing]:
    """From above and from the side, for each ground truth."""
    groups = _same_truth(results)
    drawings = []
    for number, group in enumerate(groups):
        # Several plots are told apart by the names of what they show; a single one may be large.
        names = f": {_names(group)}" if len(groups) > 1 else ""
        drawings.append(_from_above(group, f"above-{number}", names, is_hero=len(groups) == 1))
        drawings.append(_from_side(group, f"side-{number}", names))
    return drawings


def _same_truth(results: list[Result]) -> list[Group]:
    """Results that have a trajectory, grouped by ground truth: each group goes into one plot."""
    groups: dict[bytes, Group] = {}
    for index, result in numbered_where(results, lambda result: result.estimate is not None):
        # Without a truth each map has a frame of its own.
        key = result.reference_path().tobytes() if result.error else f"{index}".encode()
        groups.setdefault(key, []).append((index, result))
    return list(groups.values())


def _names(group: Group) -> str:
    return ", ".join(result.name for _, result in group)


def _draw_group(axes: Axes, group: Group, across: int, along: int) -> None:
    reference = group[0][1].reference_path()
    if group[0][1].error:
        truth = thin(reference[:, across], reference[:, along])
        axes.plot(*truth, color=TRUTH, linewidth=4.5, label="ground truth", solid_capstyle="round")
    for position, (index, result) in enumerate(group):
        if len(group) == 1 and result.live is not None:
            live, style = result.in_truth(result.live.positions), (0, (4, 2))
            line = thin(live[:, across], live[:, along])
            label = "as published during the run"
            axes.plot(*line, color=color_of(NUM_SERIES - 1), linewidth=1, linestyle=style, label=label)
        path = result.path()
        axes.plot(
            *thin(path[:, across], path[:, along]),
            color=color_of(index),
            linestyle=dashes_of(index),
            linewidth=width_of(position, len(group)),
            label="estimate" if len(group) == 1 else short(result.name),
        )
    _draw_loops(axes, group, across, along)
    axes.plot(*reference[0, [across, along]], "o", color=INK, markersize=6, label="start")


def _draw_loops(axes: Axes, group: Group, across: int, along: int) -> None:
    label: str | None = "loop closed"
    for ends in [ends for _, result in group for ends in result.loop_lines()]:
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


def _from_above(group: Group, key: str, names: str, is_hero: bool) -> Drawing:
    across, along = widest_axes(group[0][1].reference_path())
    unit = group[0][1].unit

    def draw(size: tuple[int, int], name: str, columns: int) -> str:
        figure = new_figure(*size)
        axes = figure.subplots()
        _draw_group(axes, group, across, along)
        axes.set(xlabel=f"{AXES[across]} [{unit}]", ylabel=f"{AXES[along]} [{unit}]")
        axes.set_aspect("equal", adjustable="datalim")
        if len(group) == 1:
            draw_grid(axes, group[0][1], across, along)
        add_legend(figure, columns)
        return to_svg(figure, name, label)

    label = _label(group, f"seen from above, {AXES[across]} and {AXES[along]}")
    note = "The two axes along which the path is longest, drawn to scale."
    if len(group) == 1 and group[0][1].live is not None:
        note += " The solid line is the path after all optimization, the dashed one as it was published frame by frame."
    if any(result.loops for _, result in group):
        note += " A line with circles connects a keyframe that closed a loop with the one it was matched with."
    if len(group) == 1 and group[0][1].grid is not None:
        note += " Under it, the occupancy grid: dark is occupied, light is free."
    title, small = f"The path from above{names}", draw(PHONE_HERO, f"{key}-small", 2)
    if not is_hero:
        return Drawing(title, label, note, small)
    return Drawing(title, label, note, draw(HERO, key, 5), small, is_hero=True)


def _from_side(group: Group, key: str, names: str) -> Drawing:
    across, along = widest_axes(group[0][1].reference_path())
    upright = 3 - across - along
    unit = group[0][1].unit
    figure = new_figure(*(PHONE_HERO if names else CARD))
    axes = figure.subplots()
    _draw_group(axes, group, across, upright)
    if upright == 1:
        axes.invert_yaxis()  # a camera's y axis points down
    axes.set(xlabel=f"{AXES[across]} [{unit}]", ylabel=f"{AXES[upright]} [{unit}]")
    label = _label(group, f"seen from the side, {AXES[across]} and {AXES[upright]}")
    note = "The third axis against the longest; the two have different scales."
    return Drawing(f"The path from the side{names}", label, note, to_svg(figure, key, label))


def _label(group: Group, view: str) -> str:
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
    has_times = all(result.truth is not None and result.truth.has_times for _, result in numbered)
    worst = []
    for position, (index, result) in enumerate(numbered):
        error = result.error
        assert error is not None
        seconds = error.timestamps_s - (start_s(result) if has_times else 0.0)
        axes.plot(
            *thin(seconds, error.errors_m),
            color=color_of(index),
            linestyle=dashes_of(index),
            linewidth=width_of(position, len(numbered)),
            label="error" if len(results) == 1 else short(result.name),
        )
        if len(results) == 1:
            axes.axhline(error.rms_m, color=INK, linestyle="--", linewidth=1, label=f"RMS {error.rms_m:.3f} m")
        worst.append(f"{result.name}: RMS {error.rms_m:.3f} m, at most {error.errors_m.max():.3f} m")
    if has_times:
        mark_loops(axes, numbered)
    axes.set(xlabel="time [s]" if has_times else "frame", ylabel="error [m]", ylim=(0, None))
    add_legend(figure, 3 if len(results) == 1 else 2)
    label = f"Distance between estimated and true position along the path. {'; '.join(worst)}."
    note = "Distance from the true position, after alignment of the whole path."
    return Drawing("Error along the path", label, note, to_svg(figure, "errors", label))
