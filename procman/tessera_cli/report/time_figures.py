"""Figures of the time that frames and processes took."""

import numpy as np
from matplotlib.axes import Axes

from tessera_cli.constants import MAX_EXTRACTORS_SHOWN
from tessera_cli.report.drawing import CARD, Drawing, add_legend, color_of, dashes_of, in_order, numbered_where, short
from tessera_cli.report.svg import INK, new_figure, to_svg
from tessera_cli.runs.run_folder import Frames, Result

RATE_BINS = (8, 60)
TIMES = (
    ("pose_time_ms", "pose time [ms]", "from one pose to the next"),
    ("latency_ms", "latency [ms]", "from the capture of a frame to its pose"),
    ("map_wait_ms", "wait for the map [ms]", "of the tracker"),
)


def draw_pose_times(results: list[Result]) -> Drawing | None:
    numbered = numbered_where(results, lambda result: result.frames is not None)
    samples = {name: [_known(result, name) for _, result in numbered] for name, _, _ in TIMES}
    measures = [measure for measure in TIMES if any(len(sample) for sample in samples[measure[0]])]
    if not measures:
        return None
    figure = new_figure(CARD[0], max(CARD[1], 40 + len(measures) * (50 + 22 * len(numbered))))
    all_axes = figure.subplots(len(measures), 1, squeeze=False)[:, 0]
    words = []
    for axes, (name, axis, meaning) in zip(all_axes, measures):
        draw_boxes(axes, samples[name], [color_of(index) for index, _ in numbered])
        names = [short(result.name) for _, result in numbered] if len(numbered) > 1 else [""]
        axes.set_yticks(range(len(names)), names)
        axes.set(xlabel=f"{axis}, {meaning}", xlim=(0, None))
        words += [
            f"{result.name}: {axis} median {np.median(sample):.1f}, 95 percent below {np.percentile(sample, 95):.1f}"
            for (_, result), sample in zip(numbered, samples[name])
            if len(sample)
        ]
    label = f"Boxplots of the time per frame. {'; '.join(words)}."
    note = "Box: half of all frames; line in it: median; whiskers: 5 % and 95 %; diamond: 99 %."
    return Drawing("Time per frame", label, note, to_svg(figure, "times", label))


def _known(result: Result, column: str) -> np.ndarray:
    """The values of a column of frames.csv where it is known."""
    values: np.ndarray = getattr(result.frames, column)
    return values[np.isfinite(values)]


def draw_boxes(axes: Axes, samples: list[np.ndarray], colors: list[str]) -> None:
    """Horizontal, the first on top."""
    drawn = axes.boxplot(
        [sample if len(sample) else [np.nan] for sample in samples],
        positions=list(range(len(samples))),
        orientation="horizontal",
        widths=0.6,
        whis=(5, 95),
        showfliers=False,
        patch_artist=True,
        manage_ticks=False,
        medianprops={"color": INK, "linewidth": 2},
        whiskerprops={"color": INK},
        capprops={"color": INK},
    )
    for row, (box, sample, color) in enumerate(zip(drawn["boxes"], samples, colors)):
        box.set(facecolor=color, edgecolor=INK, linewidth=0.8)
        if len(sample):
            axes.plot(np.percentile(sample, 99), row, "D", color=color, markersize=5)
    axes.set_ylim(len(samples) - 0.4, -0.6)
    axes.grid(axis="y", visible=False)


def process_values(by_process: dict[str, float]) -> dict[str, float]:
    """Many extractors as one sum."""
    extractors = [name for name in by_process if name.startswith("extractor_")]
    if len(extractors) <= MAX_EXTRACTORS_SHOWN:
        return dict(by_process)
    kept = {name: value for name, value in by_process.items() if name not in extractors}
    return {**kept, f"extractors ({len(extractors)})": sum(by_process[name] for name in extractors)}


def draw_cpu(results: list[Result]) -> Drawing | None:
    return draw_bars(
        [result.name for result in results],
        [process_values(result.summary.get("cpu_s") or {}) for result in results],
        title="CPU per process",
        axis="CPU time [s]",
        meaning="CPU seconds of each process",
        note="What the kernel accounted to each process over the whole run.",
    )


def draw_steps(results: list[Result]) -> Drawing | None:
    steps = [result.summary.get("stage_ms") or {} for result in results]
    return draw_bars(
        [result.name for result in results],
        [{name: step["median"] for name, step in of_stages.items()} for of_stages in steps],
        title="One step of each process",
        axis="median step [ms]",
        meaning="Median milliseconds of one step of each process",
        note="A step is a frame, for extractors a tile of a frame, for the mapper a keyframe.",
    )


def draw_bars(
    names: list[str],
    by_name: list[dict[str, float]],
    *,
    title: str,
    axis: str,
    meaning: str,
    note: str,
) -> Drawing | None:
    """`by_name`: for each of the names the values of its processes; one without any gets no bars.

    `title` must be the figure's own on the page.
    """
    processes = in_order({process for values in by_name for process in values})
    if not processes:
        return None
    drawn = [index for index, values in enumerate(by_name) if values]
    figure = new_figure(CARD[0], max(CARD[1], 50 + len(processes) * (10 + 14 * len(drawn))))
    axes = figure.subplots()
    height = 0.8 / len(drawn)
    for position, index in enumerate(drawn):
        rows = np.arange(len(processes)) + (position - (len(drawn) - 1) / 2) * height
        values = [by_name[index].get(process, 0.0) for process in processes]
        bars = axes.barh(rows, values, height=height * 0.9, color=color_of(index), label=short(names[index]))
        axes.bar_label(bars, fmt="%.1f", padding=3, color=INK, fontsize=11)
    axes.set_yticks(range(len(processes)), processes)
    axes.invert_yaxis()
    axes.set(xlabel=axis)
    axes.margins(x=0.14)
    axes.grid(axis="y", visible=False)
    if len(names) > 1:
        add_legend(figure, 2)
    words = []
    for index in drawn:
        figures = ", ".join(f"{name} {value:.1f}" for name, value in by_name[index].items())
        words.append(f"{names[index]}: {figures}")
    label = f"{meaning}. {'; '.join(words)}."
    return Drawing(title, label, note, to_svg(figure, title, label))


def draw_frame_rate(results: list[Result]) -> Drawing | None:
    numbered = [
        (index, result, result.frames)
        for index, result in enumerate(results)
        if result.frames is not None and np.nansum(result.frames.pose_time_ms) > 0
    ]
    if not numbered:
        return None
    figure = new_figure(*CARD)
    axes = figure.subplots()
    words = []
    for index, result, frames in numbered:
        published_s = 1e-3 * np.cumsum(np.nan_to_num(frames.pose_time_ms))
        num_bins = int(np.clip(published_s[-1], *RATE_BINS))
        counts, edges = np.histogram(published_s, bins=num_bins, range=(0.0, published_s[-1]))
        rate = counts / np.diff(edges)
        axes.stairs(
            rate,
            edges,
            color=color_of(index),
            linestyle=dashes_of(index),
            linewidth=1.8,
            baseline=None,
            label="poses per second" if len(results) == 1 else short(result.name),
        )
        mean = len(published_s) / published_s[-1]
        words.append(f"{result.name}: between {rate.min():.0f} and {rate.max():.0f}, {mean:.1f} on average")
    if (camera_rate := _camera_rate(numbered[0][2])) is not None:
        axes.axhline(camera_rate, color=INK, linestyle="--", linewidth=1, label="the camera's own")
    axes.set(xlabel="time of the run [s]", ylabel="frames per second", ylim=(0, None))
    add_legend(figure, 2)
    label = f"Frames per second over the run. {'; '.join(words)}."
    note = "Poses published per second; above the dashed line the stack is faster than the camera was."
    return Drawing("Frame rate", label, note, to_svg(figure, "rate", label))


def _camera_rate(frames: Frames) -> float | None:
    """Frames per second in the source; None for fewer than two."""
    times_s = frames.times_s
    if len(times_s) < 2 or times_s[-1] <= times_s[0]:
        return None
    return (len(times_s) - 1) / float(times_s[-1] - times_s[0])
