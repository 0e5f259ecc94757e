"""All figures of a report, and those of the map. Each is drawn for one result or for several beside each other; it is
left out where no result has what it shows."""

import numpy as np

from tessera_cli.report.drawing import (
    CARD,
    Drawing,
    add_legend,
    color_of,
    dashes_of,
    numbered_where,
    short,
    start_s,
    thin,
)
from tessera_cli.report.path_figures import draw_errors, draw_ways
from tessera_cli.report.svg import BAD, drawing_style, new_figure, to_svg
from tessera_cli.report.time_figures import draw_cpu, draw_frame_rate, draw_pose_times, draw_steps
from tessera_cli.runs.run_folder import Result


def draw_all(results: list[Result]) -> list[Drawing]:
    drawers = (draw_errors, draw_pose_times, draw_frame_rate, draw_cpu, draw_steps, draw_map_growth, draw_inliers)
    with drawing_style():
        drawings = draw_ways(results) + [draw(results) for draw in drawers]
    return [drawing for drawing in drawings if drawing]


def draw_map_growth(results: list[Result]) -> Drawing | None:
    numbered = numbered_where(
        results, lambda result: result.frames is not None and np.isfinite(result.frames.landmarks).any()
    )
    if not numbered:
        return None
    figure = new_figure(*CARD)
    upper, lower = figure.subplots(2, 1, sharex=True)
    words = []
    for index, result in numbered:
        frames, style = result.frames, {"color": color_of(index), "linestyle": dashes_of(index)}
        seconds, made = frames.times_s - start_s(result), np.cumsum(frames.is_keyframe)
        upper.plot(*thin(seconds, made), **style, label=short(result.name))
        lower.plot(*thin(seconds, frames.landmarks / 1000), **style)
        words.append(f"{result.name}: {made[-1]} keyframes made, {np.nanmax(frames.landmarks):.0f} landmarks at most")
    upper.set(ylabel="keyframes", ylim=(0, None))
    lower.set(xlabel="time in the source [s]", ylabel="landmarks [1000]", ylim=(0, None))
    figure.align_ylabels()
    if len(results) > 1:
        add_legend(figure, 2)
    label = f"Growth of the map. {'; '.join(words)}."
    return Drawing(
        "Keyframes and landmarks",
        label,
        "Keyframes that the tracker made, of which the mapper removes those that add nothing; landmarks in the tracker's map.",
        to_svg(figure, "map", label),
    )


def draw_inliers(results: list[Result]) -> Drawing | None:
    numbered = numbered_where(
        results, lambda result: result.frames is not None and np.isfinite(result.frames.inliers).any()
    )
    if not numbered:
        return None
    figure = new_figure(*CARD)
    axes = figure.subplots()
    words, lost_label = [], "lost"
    for index, result in numbered:
        frames = result.frames
        seconds = frames.times_s - start_s(result)
        axes.plot(
            *thin(seconds, frames.inliers),
            color=color_of(index),
            linestyle=dashes_of(index),
            linewidth=1.2,
            label="points on the pose" if len(results) == 1 else short(result.name),
        )
        lost = np.array([state == "lost" for state in frames.states])
        if lost.any():
            axes.plot(seconds[lost], np.zeros(lost.sum()), "|", color=BAD, markersize=14, label=lost_label)
            lost_label = None
        words.append(f"{result.name}: median {np.nanmedian(frames.inliers):.0f} points, {lost.sum()} frames lost")
    axes.set(xlabel="time in the source [s]", ylabel="points", ylim=(0, None))
    add_legend(figure, 2)
    label = f"Landmarks that agree with the pose of each frame. {'; '.join(words)}."
    return Drawing(
        "How well each frame was held",
        label,
        "Landmarks found in the image that agree with its pose; red marks are lost frames.",
        to_svg(figure, "matches", label),
    )
