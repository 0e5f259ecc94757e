"""What other programs read of a run is what the run says."""

import base64
import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from helpers.made_map import is_close, make_change, make_delta, make_keyframe, make_observation, two_views
from helpers.made_run import NUM_FRAMES, write_run
from tessera_cli.export.colmap import model_of, write_model
from tessera_cli.export.foxglove import point_cloud
from tessera_cli.export.mcap_file import entries_of, write_mcap
from tessera_cli.maps.map_replica import MapReplica
from tessera_cli.runs.run_folder import read_run

SECOND_PART = {"new_keyframes": [make_keyframe(9, 40.0, [(1.0, 1.0)], parent=-1)]}


def made_replica(*changes: Any) -> MapReplica:
    replica = MapReplica()
    for number, change in enumerate([two_views(), *changes]):
        replica.apply(make_delta(number, change).change)
    return replica


def read_back(path: Path) -> dict[str, list[tuple[str, int, Any]]]:
    """By topic: schema, time in ns and content of each message."""
    messages = defaultdict(list)
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None and channel.message_encoding == "json"
            assert json.loads(schema.data)["title"] == schema.name
            messages[channel.topic].append((schema.name, message.log_time, json.loads(message.data)))
    return messages


def test_an_mcap_file_holds_the_run(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    result = read_run(folder)
    assert result.estimate is not None
    count = write_mcap(tmp_path / "run.mcap", entries_of(folder, result, made_replica()))
    messages = read_back(tmp_path / "run.mcap")
    assert sum(map(len, messages.values())) == count
    schema, time_ns, last = messages["/pose"][-1]
    assert schema == "foxglove.PoseInFrame"
    assert time_ns == round(0.1 * (NUM_FRAMES - 1) * 10) * 100_000_000
    assert is_close(list(last["pose"]["position"].values()), result.estimate.positions[-1])
    assert len(messages["/tf"]) == len(messages["/pose"]) + 1
    assert [len(content["poses"]) for _, _, content in messages["/truth"]] == [NUM_FRAMES]
    assert [len(content["poses"]) for _, _, content in messages["/keyframes"]] == [2]
    cloud = messages["/map"][0][2]
    points = np.frombuffer(base64.b64decode(cloud["data"]), "<f4").reshape(-1, 3)
    assert is_close(points, [[0, 0, 5], [1, 0, 5]])
    frames = messages["/frame"]
    assert len(frames) == NUM_FRAMES
    assert "pose_time_ms" not in frames[0][2], "the first frame has none, and JSON no word for that"


def test_points_are_exported_with_their_colors() -> None:
    colors = np.array([[1, 2, 3], [4, 5, 6]], np.uint8)
    cloud = point_cloud(0, np.array([[0.0, 0, 5], [1, 0, 5]]), colors)
    assert [field["name"] for field in cloud["fields"]] == ["x", "y", "z", "red", "green", "blue", "alpha"]
    assert [field["offset"] for field in cloud["fields"]] == [0, 4, 8, 12, 13, 14, 15]
    points = np.frombuffer(base64.b64decode(cloud["data"]), np.uint8).reshape(-1, cloud["point_stride"])
    assert points[:, 12:].tolist() == [[1, 2, 3, 255], [4, 5, 6, 255]]
    assert is_close(points[:, :12].copy().view("<f4"), [[0, 0, 5], [1, 0, 5]])


def test_up_is_up(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    _, _, _, root = next(entries_of(folder, read_run(folder), made_replica()))
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_quat(list(root["rotation"].values()))
    assert (root["parent_frame_id"], root["child_frame_id"]) == ("map", "world")
    assert is_close(turned.apply([[0, -1, 0], [0, 0, 1]]), [[0, 0, 1], [0, 1, 0]])


def test_an_occupancy_grid_is_exported_with_its_plane(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    (folder / "occupancy.pgm").write_bytes(b"P5\n3 2\n255\n" + bytes([0, 205, 254, 254, 254, 0]))
    (folder / "occupancy.yaml").write_text("image: occupancy.pgm\nresolution: 0.5\norigin: [-1.0, 2.0, 0.0]\n")
    entries = {topic: content for topic, _, _, content in entries_of(folder, read_run(folder), made_replica())}
    grid = entries["/occupancy"]
    assert base64.b64decode(grid["data"]) == bytes([254, 254, 0, 0, 205, 254]), "rows begin with the lowest y"
    position = grid["pose"]["position"]
    assert (position["x"], position["z"]) == (-1.0, 2.0), "the grid's y axis is the camera's forward"


def test_a_model_has_the_largest_part_of_the_map() -> None:
    model = model_of(made_replica(make_change(**SECOND_PART)))
    assert sorted(model.keyframes) == [0, 1]
    assert model.landmarks.tolist() == [3], "one observer does not determine landmark 5"
    assert model.tracks[0].tolist() == [[0, 0], [1, 0]]
    assert is_close(model.errors_px, [0])


def test_errors_are_distances_in_the_image() -> None:
    worse = made_replica(
        make_change(
            removed_observations=[make_observation(3, 0, 0)],
            new_observations=[make_observation(3, 0, 1)],
        )
    )
    error = np.hypot(310, 230) / 2
    assert is_close(model_of(worse).errors_px, [error]), "keypoint 1 of keyframe 0 is at (10, 10)"


def test_colmap_reads_the_model_back(tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not installed: pip install it to check the model")
    replica = made_replica()
    replica.apply(make_delta(1, make_change(new_observations=[make_observation(5, 0, 1)])).change)
    model = model_of(replica)
    write_model(model, tmp_path, None)
    read = pycolmap.Reconstruction(tmp_path)
    assert read.num_images() == 2 and read.num_points3D() == 2
    read.update_point_3d_errors()
    errors = [read.points3D[number + 1].error for number in model.landmarks.tolist()]
    assert is_close(errors, model.errors_px)
    image = read.images[2]
    assert is_close(image.projection_center(), [0.5, 0, 0])
    assert is_close(image.points2D[0].xy, [270.5, 240.5]), "pixels are counted from the corner"


def test_colmap_s_cameras_have_the_distortion_that_the_mapper_found(tmp_path: Path) -> None:
    replica = made_replica()
    other = make_change()
    other.fx, other.fy, other.radial = 490.0, 490.0, -0.01
    replica.apply(make_delta(1, other).change)
    write_model(model_of(replica), tmp_path, None)
    name, *numbers = (tmp_path / "cameras.txt").read_text().splitlines()[1].split()[1:]
    fx, fy, cx, cy, k1, k2, p1, p2 = (float(number) for number in numbers[2:])
    assert (name, fx, fy, p1, p2) == ("OPENCV", 490, 490, 0, 0)
    # A pinhole's pixels of the corrected image, and where COLMAP's formula puts them in the camera's.
    corrected = np.array([[5.0, 5.0], [600.0, 400.0], [320.0, 239.0]])
    x = (corrected + 0.5 - [cx, cy]) / [fx, fy]
    squares = (x**2).sum(axis=1, keepdims=True)
    expected = x * (1 + k1 * squares + k2 * squares**2) * [fx, fy] + [cx, cy] - 0.5
    assert np.abs(replica.keyframes[0].camera.seen(corrected) - expected).max() < 0.02
    first = (tmp_path / "images.txt").read_text().splitlines()[2].split()
    assert is_close([float(first[3]), float(first[4])], [10.5, 10.5]), "keypoints stand in the camera's image"
