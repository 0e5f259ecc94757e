"""performance.html: the table of a comparison and its pictures, in one file that needs no network."""

from pathlib import Path

import numpy as np

from tessera_cli.experiments.measurements import Measurement
from tessera_cli.experiments.tables import NOTHING, Comparison
from tessera_cli.report.drawing import CARD, Drawing, add_legend, color_of
from tessera_cli.report.page import write_page
from tessera_cli.report.svg import drawing_style, new_figure, to_svg
from tessera_cli.report.time_figures import draw_bars
from tessera_cli.versions import collect_versions


def write_comparison_page(
    path: Path, names: list[str], comparisons: list[Comparison], ways: list[Drawing | None], remarks: list[str]
) -> None:
    """`names`: of this commit and, if there is one, of that. `ways`: of frames, for each comparison."""
    with drawing_style():
        drawings = [
            drawing for each, way in zip(comparisons, ways) for drawing in [way, *_draw(each, names)] if drawing
        ]
    write_page(
        path,
        "comparison.html",
        title="Performance" if len(names) < 2 else f"Performance: {names[0]} against {names[1]}",
        names=names,
        headline=headline(comparisons),
        remarks=remarks,
        comparisons=[{"name": each.sequence.title, "note": _note(each), "rows": each.rows()} for each in comparisons],
        nothing=NOTHING,
        drawings=drawings,
        versions=collect_versions(),
    )


def headline(comparisons: list[Comparison]) -> list[str]:
    """Sentences, the most important first."""
    judged = [row for each in comparisons for row in each.rows() if row.is_met is not None]
    sentences = [f"{sum(row.is_met is True for row in judged)} of {len(judged)} targets are met."]
    missed = [(each, [row.figure for row in each.rows() if row.is_met is False]) for each in comparisons]
    if words := [f"{each.sequence.title} ({', '.join(figures)})" for each, figures in missed if figures]:
        sentences.append(f"Missed: {'; '.join(words)}.")
    return sentences


def _note(comparison: Comparison) -> str:
    runs = comparison.this
    words = [comparison.sequence.source, f"{runs[0].frames} frames", f"{len(runs)} runs"]
    return ", ".join(words[: 2 if len(runs) == 1 else 3])


def _draw(comparison: Comparison, names: list[str]) -> list[Drawing | None]:
    sides = [runs for runs in (comparison.this, comparison.that) if runs]
    name = comparison.sequence.title
    cpu = draw_bars(
        names[: len(sides)],
        [_median_cpu(runs) for runs in sides],
        title=f"{name}: CPU time",
        axis="CPU time [ms per frame]",
        meaning=f"{name}: CPU milliseconds per frame of each process",
        note="Medians over the runs of what the kernel accounted to each process.",
    )
    return [cpu, _draw_speeds(name, names, sides)]


def _median_cpu(runs: list[Measurement]) -> dict[str, float]:
    kinds = {kind for run in runs for kind in run.cpu_ms}
    return {kind: float(np.median([run.cpu_ms.get(kind, 0.0) for run in runs])) for kind in sorted(kinds)}


def _draw_speeds(name: str, names: list[str], sides: list[list[Measurement]]) -> Drawing | None:
    """Of each run, in the order in which they were made: a drift of the machine is seen. None for one run each."""
    if max(len(runs) for runs in sides) < 2:
        return None
    figure = new_figure(*CARD)
    axes = figure.subplots()
    words = []
    for side, runs in enumerate(sides):
        speeds = [run.frames_per_s for run in runs]
        at = np.arange(1, len(runs) + 1) + side / len(sides)
        axes.plot(at, speeds, "o-", color=color_of(side), label=names[side], markersize=6, linewidth=1)
        axes.axhline(float(np.median(speeds)), color=color_of(side), linewidth=1, linestyle=(0, (4, 3)))
        words.append(f"{names[side]}: {', '.join(f'{speed:.1f}' for speed in speeds)}")
    axes.set(xlabel="repetition", ylabel="frames per second", ylim=(0, None))
    axes.set_xticks(range(1, max(len(runs) for runs in sides) + 1))
    if len(sides) > 1:
        add_legend(figure, 2)
    label = f"{name}: frames per second of each run. {'; '.join(words)}."
    note = "Each run, in the order in which they were made. Dashed: the medians."
    title = f"{name}: speed of each run"
    return Drawing(title, label, note, to_svg(figure, title, label))
