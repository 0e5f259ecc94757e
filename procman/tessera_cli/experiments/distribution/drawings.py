"""Pictures of a distribution experiment: scaling, time between poses, traffic, latency, and the paths overlaid."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes

from tessera_cli.experiments.distribution.figures import Cell
from tessera_cli.experiments.distribution.grid import ALONE, Configuration
from tessera_cli.experiments.distribution.outcome import Outcome, folder_of
from tessera_cli.report.drawing import CARD, Drawing, add_legend, color_of, dashes_of
from tessera_cli.report.path_figures import draw_paths
from tessera_cli.report.svg import INK, new_figure, to_svg
from tessera_cli.report.time_figures import draw_boxes
from tessera_cli.runs.run_folder import read_run

MAX_PATHS = 4
BOX_HEIGHT = 24


def draw_all(outcomes: Sequence[Outcome]) -> list[Drawing]:
    """One kind after the other. Use within `drawing_style()`."""
    drawings = []
    for draw in (draw_scaling, draw_pose_times, draw_traffic, draw_latency):
        for outcome in outcomes:
            prefix = f"{outcome.name}: " if len(outcomes) > 1 else ""
            if drawing := draw(outcome, prefix):
                drawings.append(drawing)
    return drawings + draw_trajectories(outcomes)


def draw_scaling(outcome: Outcome, prefix: str) -> Drawing | None:
    """Poses per second over the number of extractors, and the line of one extractor's speed times their number."""
    cells = outcome.of_variant("")
    if not cells:
        return None
    figure = new_figure(*CARD)
    axes = figure.subplots()
    words = []
    for index, tiles in enumerate(outcome.cuts):
        chosen = [cell for cell in cells if cell.configuration.tiles == tiles]
        numbers = [cell.configuration.extractors for cell in chosen]
        spreads = [found for cell in chosen if (found := cell.spread(lambda run: run.poses_per_s))]
        medians = np.array([each.median for each in spreads])
        errors = [medians - [each.lowest for each in spreads], [each.highest for each in spreads] - medians]
        style = {"color": color_of(index), "linestyle": dashes_of(index), "label": tiles}
        axes.errorbar(numbers, medians, errors, marker="o", markersize=4, linewidth=1.5, capsize=3, **style)
        words.append(f"{tiles}: {', '.join(f'P={n} {v:.1f}' for n, v in zip(numbers, medians))}")
    if one := outcome.cell(1, "1x1"):
        ends = np.array([1, outcome.extractors[-1]])
        ideal = ends * one.median(lambda run: run.poses_per_s)
        axes.plot(ends, ideal, color=INK, linestyle=(0, (4, 3)), linewidth=1, label="ideal")
    _count_extractors(axes, outcome)
    axes.set(ylabel="poses per second", ylim=(0, None))
    add_legend(figure, 3)
    title = f"{prefix}Speed over the number of extractors"
    label = f"{title}. {'; '.join(words)}."
    note = "Medians with the lowest and the highest of all repetitions. Ideal: P times one extractor with whole images."
    return Drawing(title, label, note, to_svg(figure, title, label))


def _count_extractors(axes: Axes, outcome: Outcome) -> None:
    axes.set_xticks(outcome.extractors)
    axes.set(xlabel="extractors P")


def draw_pose_times(outcome: Outcome, prefix: str) -> Drawing | None:
    cells = outcome.of_variant("")
    most = outcome.extractors[-1]
    chosen = [
        cell for cell in cells if cell.configuration.tiles == outcome.cuts[0] or cell.configuration.extractors == most
    ]
    if not chosen:
        return None
    figure = new_figure(CARD[0], max(CARD[1], 50 + BOX_HEIGHT * len(chosen)))
    axes = figure.subplots()
    samples = [np.concatenate([run.pose_times_ms for run in cell.runs]) for cell in chosen]
    draw_boxes(axes, samples, [color_of(outcome.cuts.index(cell.configuration.tiles)) for cell in chosen])
    names = [_name(cell.configuration) for cell in chosen]
    axes.set_yticks(range(len(names)), names)
    axes.set(xlabel="time between poses [ms]", xlim=(0, None))
    medians = ", ".join(f"{name} {np.median(sample):.0f}" for name, sample in zip(names, samples))
    title = f"{prefix}Time between poses"
    label = f"{title}, boxplots; medians in milliseconds: {medians}."
    note = "Box: half of all frames; line in it: median; whiskers: 5 % and 95 %; diamond: 99 %."
    return Drawing(title, label, note, to_svg(figure, title, label))


def _name(configuration: Configuration) -> str:
    return f"P = {configuration.extractors}, {configuration.tiles}"


def draw_traffic(outcome: Outcome, prefix: str) -> Drawing | None:
    """For the most extractors, by cut: what the first host sends and receives, and another host receives."""
    cells = [cell for cell in outcome.of_variant("") if cell.configuration.extractors == outcome.extractors[-1]]
    if not cells:
        return None
    bars = _traffic_bars(outcome, cells)
    figure = new_figure(*CARD)
    axes = figure.subplots()
    width = 0.8 / len(bars)
    words = []
    for index, (name, values) in enumerate(bars.items()):
        at = np.arange(len(cells)) + (index - (len(bars) - 1) / 2) * width
        drawn = axes.bar(at, values, width * 0.92, color=color_of(index), label=name)
        axes.bar_label(drawn, fmt="%.0f", padding=2, color=INK, fontsize=9)
        words.append(f"{name}: {', '.join(f'{value:.0f}' for value in values)}")
    cuts = [cell.configuration.tiles for cell in cells]
    axes.set_xticks(range(len(cuts)), cuts)
    axes.set(xlabel="cut", ylabel="kB per frame")
    axes.margins(y=0.12)
    axes.grid(axis="x", visible=False)
    add_legend(figure, 1)
    title = f"{prefix}Traffic by cut"
    label = f"{title}, kilobytes per frame, for cuts {', '.join(cuts)}. {'; '.join(words)}."
    note = f"From the interfaces' counters, P = {outcome.extractors[-1]}, all headers and what was sent again included."
    return Drawing(title, label, note, to_svg(figure, title, label))


def _traffic_bars(outcome: Outcome, cells: list[Cell]) -> dict[str, list[float]]:
    def per_frame_kb(cell: Cell, host: int, direction: str) -> float:
        return cell.median(lambda run: getattr(run.traffic[host], direction) / 1000 / run.measurement.frames)

    if not outcome.experiment.extractors_per_host:
        return {"within the host": [per_frame_kb(cell, 1, "sent") for cell in cells]}
    return {
        "estimating host sends": [per_frame_kb(cell, 1, "sent") for cell in cells],
        "estimating host receives": [per_frame_kb(cell, 1, "received") for cell in cells],
        "a host of extractors receives": [per_frame_kb(cell, 2, "received") for cell in cells],
    }


def draw_latency(outcome: Outcome, prefix: str) -> Drawing | None:
    cells = outcome.of_variant(ALONE)
    if not cells:
        return None
    figure = new_figure(*CARD)
    axes = figure.subplots()
    words = []
    for index, tiles in enumerate(outcome.cuts):
        chosen = [cell for cell in cells if cell.configuration.tiles == tiles]
        numbers = [cell.configuration.extractors for cell in chosen]
        medians = [float(np.median(np.concatenate([run.latencies_ms for run in cell.runs]))) for cell in chosen]
        axes.plot(numbers, medians, "o-", color=color_of(index), markersize=4, label=tiles)
        words.append(f"{tiles}: {', '.join(f'P={n} {v:.0f}' for n, v in zip(numbers, medians))}")
    _count_extractors(axes, outcome)
    axes.set(ylabel="latency [ms]", ylim=(0, None))
    add_legend(figure, 3)
    title = f"{prefix}Latency of a frame by cut"
    label = f"{title}, median milliseconds, one frame at a time. {'; '.join(words)}."
    note = "From the camera to the pose, median, one frame at a time: no frame waits for another one."
    return Drawing(title, label, note, to_svg(figure, title, label))


def draw_trajectories(outcomes: Sequence[Outcome]) -> list[Drawing]:
    """The coarsest and the finest of each experiment, and those with other results than the first."""
    results = []
    for outcome in outcomes:
        prefix = f"{outcome.name}, " if len(outcomes) > 1 else ""
        cells = outcome.of_variant("") or list(outcome.cells.values())
        differing = [cell for cell in cells if cell.hashes != cells[0].hashes]
        chosen = dict.fromkeys(each.configuration for each in [cells[0], cells[-1], *differing])
        for configuration in list(chosen)[:MAX_PATHS]:
            name = f"{prefix}{_name(configuration)}"
            results.append(replace(read_run(folder_of(outcome, configuration)), name=name, live=None))
    return draw_paths([each for each in results if each.estimate is not None])
