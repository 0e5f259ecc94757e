"""All figures of a report, and those of the map.

Each figure is drawn for one result or for several beside each other, and left out where no result has its data.
"""

from typing import Any

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
from tessera_cli.report.path_figures import draw_errors, draw_paths
from tessera_cli.report.svg import BAD, drawing_style, new_figure, to_svg
from tessera_cli.report.time_figures import draw_cpu, draw_frame_rate, draw_pose_times, draw_steps
from tessera_cli.report.voxel_picture import draw_voxels
from tessera_cli.runs.run_folder import Frames, Result


def draw_all(results: list[Result]) -> list[Drawing]:
    drawers = (draw_errors, draw_pose_times, draw_frame_rate, draw_cpu, draw_steps, draw_map_growth, draw_inliers)
    with drawing_style():
        voxels = draw_voxels(results[0]) if len(results) == 1 else None
        drawings = [*draw_paths(results), voxels, *(draw(results) for draw in drawers)]
    return [drawing for drawing in drawings if drawing]


def _with_frames(results: list[Result], column: str) -> list[tuple[int, Result, Frames]]:
    """The results that know this column for at least one frame, with their numbers."""

    def knows_column(result: Result) -> bool:
        return result.frames is not None and bool(np.isfinite(getattr(result.frames, column)).any())

    numbered = numbered_where(results, knows_column)
    return [(index, result, result.frames) for index, result in numbered if result.frames is not None]


def draw_map_growth(results: list[Result]) -> Drawing | None:
    numbered = _with_frames(results, "landmarks")
    if not numbered:
        return None
    figure = new_figure(*CARD)
    upper, lower = figure.subplots(2, 1, sharex=True)
    words = []
    for index, result, frames in numbered:
        style: dict[str, Any] = {"color": color_of(index), "linestyle": dashes_of(index)}
        seconds, num_keyframes = frames.times_s - start_s(result), np.cumsum(frames.is_keyframe)
        upper.plot(*thin(seconds, num_keyframes), **style, label=short(result.name))
        lower.plot(*thin(seconds, frames.landmarks / 1000), **style)
        most = np.nanmax(frames.landmarks)
        words.append(f"{result.name}: {num_keyframes[-1]} keyframes made, {most:.0f} landmarks at most")
    upper.set(ylabel="keyframes", ylim=(0, None))
    lower.set(xlabel="time in the source [s]", ylabel="landmarks [1000]", ylim=(0, None))
    figure.align_ylabels()
    if len(results) > 1:
        add_legend(figure, 2)
    label = f"Growth of the map. {'; '.join(words)}."
    note = (
        "Keyframes made by the tracker, of which the mapper removes those that add nothing; "
        "landmarks in the tracker's map."
    )
    return Drawing("Keyframes and landmarks", label, note, to_svg(figure, "map", label))


def draw_inliers(results: list[Result]) -> Drawing | None:
    numbered = _with_frames(results, "inliers")
    if not numbered:
        return None
    figure = new_figure(*CARD)
    axes = figure.subplots()
    words: list[str] = []
    lost_label: str | None = "lost"
    for index, result, frames in numbered:
        seconds = frames.times_s - start_s(result)
        axes.plot(
            *thin(seconds, frames.inliers),
            color=color_of(index),
            linestyle=dashes_of(index),
            linewidth=1.2,
            label="inliers" if len(results) == 1 else short(result.name),
        )
        lost = np.array([state == "lost" for state in frames.states])
        if lost.any():
            axes.plot(seconds[lost], np.zeros(lost.sum()), "|", color=BAD, markersize=14, label=lost_label)
            lost_label = None
        words.append(f"{result.name}: median {np.nanmedian(frames.inliers):.0f} inliers, {lost.sum()} frames lost")
    axes.set(xlabel="time in the source [s]", ylabel="inliers", ylim=(0, None))
    add_legend(figure, 2)
    label = f"Landmarks that agree with the pose of each frame. {'; '.join(words)}."
    note = "Landmarks found in the image that agree with its pose; red marks are lost frames."
    return Drawing("Inliers of each frame", label, note, to_svg(figure, "matches", label))
