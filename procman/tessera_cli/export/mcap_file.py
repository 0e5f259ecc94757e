"""A run as an MCAP file for Foxglove: what stands in foxglove.py, by the mcap package."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer

from tessera_cli.export import foxglove
from tessera_cli.export.foxglove import CAMERA, MAP, MAP_FROM_WORLD_XYZW, WORLD, Json
from tessera_cli.maps.landmark_colors import read_colors
from tessera_cli.maps.map_replica import MapReplica
from tessera_cli.runs.recorded_images import color_images, left_images, recording_of, to_jpeg
from tessera_cli.runs.run_folder import Frames, Result
from tessera_cli.runs.trajectories import truth_in_estimate

# Topic, schema, time in ns, message.
Entry = tuple[str, str, int, Json]


def write_mcap(path: Path, entries: Iterator[Entry]) -> int:
    """Returns the number of messages."""
    count = 0
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="tessera")
        channels: dict[str, int] = {}
        schemas: dict[str, int] = {}
        for topic, schema, time_ns, message in entries:
            if schema not in schemas:
                text = json.dumps({"title": schema, **foxglove.SCHEMAS[schema]})
                schemas[schema] = writer.register_schema(schema, "jsonschema", text.encode())
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "json", schemas[schema])
            data = json.dumps(message, allow_nan=False).encode()
            writer.add_message(channels[topic], time_ns, data, time_ns)
            count += 1
        writer.finish()
    return count


def entries_of(folder: Path, result: Result, replica: MapReplica) -> Iterator[Entry]:
    """Everything of the folder. The map and the paths, which hold for the whole run, stand at its beginning."""
    assert result.estimate is not None
    times_ns = _nanoseconds(result.estimate.timestamps_s)
    first_s = result.frames.times_s[0] if result.frames else result.estimate.timestamps_s[0]
    begin_ns = int(_nanoseconds(np.array([first_s]))[0])
    yield from _whole_run(begin_ns, result, replica, read_colors(folder, replica))
    placed = zip(times_ns.tolist(), result.estimate.positions.tolist(), result.estimate.quaternions_xyzw.tolist())
    for time_ns, position, quaternion in placed:
        pose = {**foxglove.stamp(time_ns), "pose": foxglove.pose(position, quaternion)}
        yield "/pose", "foxglove.PoseInFrame", time_ns, pose
        transform = foxglove.transform(time_ns, WORLD, CAMERA, position, quaternion)
        yield "/tf", "foxglove.FrameTransform", time_ns, transform
    if result.frames is not None:
        yield from _frames(result.frames)
    if recording := recording_of(folder, result.settings):
        yield from _images(*recording, replica)


def _whole_run(begin_ns: int, result: Result, replica: MapReplica, colors: np.ndarray | None) -> Iterator[Entry]:
    assert result.estimate is not None
    transform = foxglove.transform(begin_ns, MAP, WORLD, (0, 0, 0), MAP_FROM_WORLD_XYZW)
    yield "/tf", "foxglove.FrameTransform", begin_ns, transform
    estimate = result.estimate
    path = foxglove.poses(begin_ns, estimate.positions, estimate.quaternions_xyzw)
    yield "/path", "foxglove.PosesInFrame", begin_ns, path
    if result.truth is not None and result.error is not None:
        truth = foxglove.poses(begin_ns, *truth_in_estimate(result.truth, result.error))
        yield "/truth", "foxglove.PosesInFrame", begin_ns, truth
    keyframes = [keyframe for _, keyframe in sorted(replica.keyframes.items())]
    if keyframes:
        positions = np.array([keyframe.translation for keyframe in keyframes])
        quaternions = np.roll([keyframe.rotation_wxyz for keyframe in keyframes], -1, axis=1)
        yield "/keyframes", "foxglove.PosesInFrame", begin_ns, foxglove.poses(begin_ns, positions, quaternions)
    landmarks = replica.positions[replica.landmark_ids()]
    yield "/map", "foxglove.PointCloud", begin_ns, foxglove.point_cloud(begin_ns, landmarks, colors)
    if result.grid is not None:
        height = float((estimate.positions @ result.grid.axes[2]).min())
        yield "/occupancy", "foxglove.Grid", begin_ns, foxglove.grid(begin_ns, result.grid, height)


def _frames(frames: Frames) -> Iterator[Entry]:
    columns: dict[str, Any] = {
        name: getattr(frames, name) for name in ("latency_ms", "pose_time_ms", "matches", "inliers")
    }
    times_ns = _nanoseconds(frames.times_s)
    for row, (number, state) in enumerate(zip(frames.numbers.tolist(), frames.states)):
        # JSON has no word for an unknown number: it is left out.
        known = {name: float(column[row]) for name, column in columns.items() if np.isfinite(column[row])}
        yield "/frame", "tessera.Frame", int(times_ns[row]), {"frame": number, "state": state, **known}


def _images(log: Path, channel_prefix: str, replica: MapReplica) -> Iterator[Entry]:
    cameras = [keyframe.camera for _, keyframe in sorted(replica.keyframes.items())[:1]]
    for _frame, utime_us, image in left_images(log, channel_prefix):
        time_ns = 1000 * utime_us
        for camera in cameras:
            yield "/calibration", "foxglove.CameraCalibration", time_ns, foxglove.calibration(time_ns, camera)
        yield "/image", "foxglove.CompressedImage", time_ns, foxglove.compressed_image(time_ns, to_jpeg(image))
    for _frame, utime_us, image in color_images(log, channel_prefix):
        time_ns = 1000 * utime_us
        yield "/image_color", "foxglove.CompressedImage", time_ns, foxglove.compressed_image(time_ns, to_jpeg(image))


def _nanoseconds(seconds: np.ndarray) -> np.ndarray:
    """Files keep microseconds."""
    return (seconds * 1e6).round().astype(np.int64) * 1000
