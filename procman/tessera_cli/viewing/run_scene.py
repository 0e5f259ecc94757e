"""A run's folder as a scene: what stands there when the run has ended.

The folder's trajectories and map are in the map's world; the truth is brought into it.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tessera_cli.maps.map_replica import MapReplica
from tessera_cli.report.viewpoint import over_the_shoulder
from tessera_cli.runs.recorded_images import best_images, to_jpeg
from tessera_cli.runs.run_folder import SAME_TIME_S, Frames, Result
from tessera_cli.runs.trajectories import Trajectory, truth_in_estimate
from tessera_cli.viewing import keypoints, map_shapes
from tessera_cli.viewing.scene import (
    CAMERA,
    CAMERA_SIZE,
    ERROR,
    ERROR_PLOT,
    GRAY,
    IMAGE,
    INLIERS,
    INLIERS_PLOT,
    LATENCY,
    LATENCY_PLOT,
    TILES,
    TRAJECTORY,
    TRUTH,
    YELLOW,
    Camera,
    Lines,
    Look,
    Moment,
    Picture,
    Poses,
    Series,
    Shown,
)


def look_of(result: Result, replica: MapReplica) -> Look:
    """From behind and above, so that the path of the camera is in sight; where it hardly moved, what it saw."""
    assert result.estimate is not None
    plots = (INLIERS_PLOT, LATENCY_PLOT, *([ERROR_PLOT] if result.error else []))
    camera = next((keyframe.camera for keyframe in replica.keyframes.values()), None)
    image_size = (camera.width, camera.height) if camera else None
    low, high = result.estimate.positions.min(axis=0), result.estimate.positions.max(axis=0)
    size = max(float(np.linalg.norm(high - low)), 1e-3)
    landmarks = replica.positions[replica.landmark_ids()]
    if len(landmarks):
        shoulder = over_the_shoulder(landmarks, result.estimate)
        if shoulder.reach > size:
            return Look(plots, image_size, shoulder.eye, shoulder.target)
    target = (low + high) / 2
    return Look(plots, image_size, target + size * np.array([0.0, -0.95, -0.7]), target)


def scene_of(result: Result, replica: MapReplica, colors: np.ndarray | None) -> Iterator[Shown]:
    """All but pictures: what is there at once. `colors`: of the landmarks, n x 3 bytes; None: not known."""
    assert result.estimate is not None
    start_s = _start_s(result)
    yield Lines(TRAJECTORY, [result.estimate.positions], YELLOW, 2.0)
    if result.truth is not None and result.error is not None:
        yield Lines(TRUTH, [truth_in_estimate(result.truth, result.error)[0]], GRAY, 2.0)
    yield from map_shapes.shapes_of(replica, colors)
    if replica.keyframes:
        yield from _camera(result, replica)
    yield _camera_poses(result.estimate, result.frames, start_s)
    if result.error is not None:
        error = result.error
        numbers = _numbers_of(error.timestamps_s, result.frames)
        yield Series(f"{ERROR}/position", numbers, error.timestamps_s - start_s, error.errors_m)
    if result.frames is not None:
        yield from series_of(result.frames, start_s)


def keyframe_keypoints(result: Result, replica: MapReplica) -> Iterator[Shown]:
    """The keypoints of each keyframe, at its frame."""
    before = np.empty(0, int)
    moments, found = [], []
    for moment, number in keyframe_moments(result, replica):
        found.append(keypoints.of_keyframe(replica.keyframes[number], replica, before))
        before = found[-1].landmarks
        moments.append(moment)
    yield from keypoints.series_of(found, moments)


def keyframe_pictures(result: Result, replica: MapReplica, log: Path, channel_prefix: str) -> Iterator[Picture]:
    """From a recording, the images of the keyframes, in color where it has that."""
    moments = {moment.frame: moment for moment, _ in keyframe_moments(result, replica)}
    for frame, _utime, image in best_images(log, channel_prefix, moments):
        yield Picture(IMAGE, to_jpeg(image), moments[frame])


def keyframe_moments(result: Result, replica: MapReplica) -> list[tuple[Moment, int]]:
    """When each keyframe was taken, and its number, in order of time."""
    start_s = _start_s(result)
    moments = [
        (Moment(keyframe.frame, 1e-6 * keyframe.utime_us - start_s), number)
        for number, keyframe in replica.keyframes.items()
    ]
    return sorted(moments, key=lambda entry: entry[0].frame)


def series_of(frames: Frames, start_s: float) -> list[Series]:
    """Curves of what each frame measured."""
    columns = {
        f"{INLIERS}/matches": frames.matches,
        f"{INLIERS}/inliers": frames.inliers,
        f"{LATENCY}/latency": frames.latency_ms,
        f"{LATENCY}/pose_time": frames.pose_time_ms,
        f"{LATENCY}/map_wait": frames.map_wait_ms,
    }
    series = []
    for path, values in columns.items():
        is_known = np.isfinite(values)
        series.append(Series(path, frames.numbers[is_known], frames.times_s[is_known] - start_s, values[is_known]))
    return series


def _camera(result: Result, replica: MapReplica) -> Iterator[Shown]:
    model = next(iter(replica.keyframes.values())).camera
    yield Camera(CAMERA, model, CAMERA_SIZE * map_shapes.frustum_depth(replica))
    lines, columns = tiles_of(result)
    if lines * columns > 1:
        yield Lines(TILES, keypoints.tile_borders(lines, columns, model.width, model.height), YELLOW, 1.0)


def tiles_of(result: Result) -> tuple[int, int]:
    """Lines and columns into which the run cut its images."""
    text = str(result.settings.get("dispatcher", {}).get("tiles") or result.summary.get("tiles") or "1x1")
    lines, _, columns = text.partition("x")
    return (int(lines), int(columns)) if lines.isdigit() and columns.isdigit() else (1, 1)


def _camera_poses(estimate: Trajectory, frames: Frames | None, start_s: float) -> Poses:
    numbers = _numbers_of(estimate.timestamps_s, frames)
    return Poses(CAMERA, numbers, estimate.timestamps_s - start_s, estimate.positions, estimate.quaternions_xyzw)


def _numbers_of(seconds: np.ndarray, frames: Frames | None) -> np.ndarray:
    """Of the frames that were taken at these times."""
    if frames is None:
        return np.arange(len(seconds))
    following = np.searchsorted(frames.times_s, seconds - SAME_TIME_S)
    return frames.numbers[np.clip(following, 0, len(frames.times_s) - 1)]


def _start_s(result: Result) -> float:
    assert result.estimate is not None
    return float(result.frames.times_s[0] if result.frames else result.estimate.timestamps_s[0])
