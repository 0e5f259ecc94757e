"""What a run's folder and the messages of a bus show."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.made_map import (
    is_close,
    make_camera,
    make_change,
    make_delta,
    make_keypoints,
    make_pose,
    received,
    set_header,
    two_views,
)
from helpers.made_run import NUM_FRAMES, write_run
from tessera_cli.maps.colors import DARKEST, HEIGHT_COLORS, height_colors, seen_colors
from tessera_cli.maps.map_replica import MapReplica
from tessera_cli.messages import message_types as tessera
from tessera_cli.report.viewpoint import over_the_shoulder
from tessera_cli.runs.recorded_images import LeftImages
from tessera_cli.runs.run_folder import read_run
from tessera_cli.runs.trajectories import Trajectory, truth_in_estimate
from tessera_cli.viewing import map_shapes, scene
from tessera_cli.viewing.bus_scene import BusScene
from tessera_cli.viewing.live_occupancy import LiveOccupancy
from tessera_cli.viewing.map_shapes import covisible_pairs
from tessera_cli.viewing.run_scene import look_of, scene_of, tiles_of


def made_replica() -> MapReplica:
    replica = MapReplica()
    replica.apply(make_delta(0, two_views()).change)
    return replica


def by_path(shapes: Any) -> dict[str, Any]:
    return {shape.path: shape for shape in shapes}


def test_a_run_shows_path_truth_map_and_curves(tmp_path: Path) -> None:
    result = read_run(write_run(tmp_path / "run"))
    shown = by_path(scene_of(result, made_replica(), None))
    assert result.estimate is not None and result.truth is not None
    assert is_close(shown[scene.TRAJECTORY].strips[0], result.estimate.positions)
    assert len(shown[scene.TRUTH].strips[0]) == NUM_FRAMES
    assert len(shown[scene.KEYFRAMES].strips) == 2
    assert len(shown[scene.LANDMARKS].positions) == 2
    assert shown[f"{scene.INLIERS}/inliers"].values[0] == 400
    assert len(shown[f"{scene.LATENCY}/pose_time"].frames) == NUM_FRAMES - 1, "the first frame has none"
    poses = shown[scene.CAMERA]
    assert poses.frames[-1] == NUM_FRAMES - 1 and poses.seconds[-1] == pytest.approx(0.1 * (NUM_FRAMES - 1))


def test_the_eye_sees_the_whole_path_or_what_the_camera_saw(tmp_path: Path) -> None:
    result = read_run(write_run(tmp_path / "run"))
    assert result.estimate is not None
    look = look_of(result, made_replica())
    assert look.eye is not None and look.target is not None
    middle = (result.estimate.positions.min(axis=0) + result.estimate.positions.max(axis=0)) / 2
    assert is_close(look.target, middle)
    assert look.eye[1] < -20, "from above: y points down"
    assert look.plots[0] == scene.INLIERS_PLOT
    far = made_replica()
    far.positions *= 1000
    look = look_of(result, far)
    assert look.target is not None and np.linalg.norm(look.target - middle) > 100, "it hardly moved"


def test_the_eye_stands_behind_and_above_the_camera_that_sees_most() -> None:
    turned = [0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)]  # looks along x
    poses = Trajectory(np.arange(2.0), np.zeros((2, 3)), np.array([[0.0, 0, 0, 1], turned]), has_times=True)
    view = over_the_shoulder(np.array([[0.0, 0, 9], [10, 1, 0], [10, -1, 1]]), poses)
    assert is_close(view.target, [10, 0, 0]) and view.distance == pytest.approx(10)
    assert view.eye[0] < 0 and view.eye[1] < 0
    assert is_close(view.world_from_eye @ view.world_from_eye.T, np.eye(3))
    assert view.world_from_eye[0, 2] > 0.9 and view.world_from_eye[1, 1] > 0.9


def test_the_truth_lies_on_the_estimate(tmp_path: Path) -> None:
    result = read_run(write_run(tmp_path / "run"))
    assert result.estimate is not None and result.truth is not None and result.error is not None
    positions, quaternions = truth_in_estimate(result.truth, result.error)
    times = (10 * result.estimate.timestamps_s).round().astype(int)
    apart = np.linalg.norm(positions[times] - result.estimate.positions, axis=1)
    assert apart.max() < 0.3, "the made run has 5 cm of noise"
    assert np.abs(quaternions[:, 3]).min() > 0.999


def test_tiles_are_those_of_the_settings(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    (folder / "settings.yaml").write_text("dispatcher:\n  tiles: 3x4\n")
    assert tiles_of(read_run(folder)) == (3, 4)
    (folder / "settings.yaml").write_text("")
    assert tiles_of(read_run(folder)) == (2, 2), "of the summary"


def test_keyframes_are_connected_by_what_they_share() -> None:
    replica = made_replica()
    assert covisible_pairs(replica, min_shared=2) == [(0, 1)], "to the parent in any case"
    replica.keyframes[1].parent = -1
    assert covisible_pairs(replica, min_shared=2) == []
    assert covisible_pairs(replica, min_shared=1) == [(0, 1)]


def test_frusta_open_toward_what_the_camera_sees() -> None:
    strip = map_shapes.frusta(made_replica(), depth=1.0)[1]
    assert is_close(strip[0], [0.5, 0, 0])
    assert is_close(strip[:, 2].max(), 1.0)
    assert is_close(strip[:, 0].max(), 0.5 + 320 / 500)


def test_higher_points_have_other_colors() -> None:
    colors = height_colors(np.array([[0.0, -2.0, 0], [0, 1.0, 0]]))
    assert (colors[0] > colors[1]).any()
    assert height_colors(np.empty((0, 3))).shape == (0, 3)


def make_pose_message(frame: int, x: float, reference: int = 0) -> Any:
    pose = set_header(tessera.pose_t())
    pose.frame, pose.utime, pose.state = frame, 100_000 * frame, pose.TRACKED
    pose.world_from_camera, pose.reference_keyframe = make_pose((x, 0.0, 0.0)), reference
    pose.reference_from_camera = make_pose((x, 0.0, 0.0))
    pose.num_inliers, pose.latency = 123, 30_000
    return received(pose)


def make_truth(frame: int, y: float) -> Any:
    truth = set_header(tessera.ground_truth_t())
    truth.frame, truth.world_from_camera = frame, make_pose((0.0, y, 0.1 * (frame % 2)))
    return received(truth)


def test_poses_show_the_camera_and_their_measures_together() -> None:
    bus = BusScene()
    bus.on_pose(make_pose_message(10, 0.0))
    bus.on_pose(make_pose_message(12, 0.2))
    shown = by_path(bus.motion())
    assert shown[f"{scene.INLIERS}/inliers"].values.tolist() == [123, 123]
    assert shown[f"{scene.LATENCY}/latency"].values.tolist() == [30, 30]
    assert shown[scene.CAMERA].frames.tolist() == [10, 12]
    assert shown[scene.CAMERA].seconds.tolist() == [0, pytest.approx(0.2)]
    assert is_close(shown[scene.CAMERA].translations, [[0, 0, 0], [0.2, 0, 0]])
    assert is_close(shown[scene.CAMERA].quaternions_xyzw, [[0, 0, 0, 1]] * 2)
    assert is_close(shown[scene.HERE].positions, [[0.2, 0, 0]])
    assert shown[scene.HERE].moment.frame == 12
    assert list(bus.motion()) == [], "each once"


def test_a_lost_frame_has_measures_and_no_camera() -> None:
    bus = BusScene()
    pose = make_pose_message(3, 0.0)
    pose.state = pose.LOST
    bus.on_pose(pose)
    shown = by_path(bus.motion())
    assert shown[f"{scene.INLIERS}/inliers"].frames.tolist() == [3]
    assert scene.CAMERA not in shown and scene.HERE not in shown


def test_the_path_moves_along_with_keyframes_also_removed_ones() -> None:
    bus = BusScene()
    bus.on_delta(make_delta(0, two_views()))
    bus.on_pose(make_pose_message(11, 0.6, reference=1))
    moved = {"moved_keyframes": [1], "world_from_camera": [make_pose((2.0, 0.0, 0.0))], "scale": [1.0]}
    bus.on_delta(make_delta(1, make_change(**moved)))
    path = by_path(bus.map_shapes())[scene.TRAJECTORY]
    assert path.strips == [], "one pose is no line"
    bus.on_pose(make_pose_message(12, 0.7, reference=1))
    path = by_path(bus.map_shapes())[scene.TRAJECTORY]
    assert is_close(path.strips[0], [[2.6, 0, 0], [2.7, 0, 0]])
    removal = make_change(
        removed_observations=two_views().new_observations[1:], removed_landmarks=[5], removed_keyframes=[1]
    )
    bus.on_delta(make_delta(2, removal))
    moved = {"moved_keyframes": [0], "world_from_camera": [make_pose((0.0, 1.0, 0.0))], "scale": [1.0]}
    bus.on_delta(make_delta(3, make_change(**moved)))
    path = by_path(bus.map_shapes())[scene.TRAJECTORY]
    assert is_close(path.strips[0], [[2.6, 1, 0], [2.7, 1, 0]])


def test_the_truth_is_brought_into_the_map() -> None:
    bus = BusScene()
    bus.on_delta(make_delta(0, two_views()))
    for frame in range(20):
        pose = set_header(tessera.pose_t())
        pose.frame, pose.state, pose.reference_keyframe = frame, pose.TRACKED, -1
        pose.world_from_camera = make_pose((0.2 * frame, 0.0, 0.2 * (frame % 2)))
        bus.on_pose(received(pose))
        bus.on_truth(make_truth(frame, 0.1 * frame))
    shown = by_path(bus.map_shapes())
    assert is_close(shown[scene.TRUTH].strips[0], shown[scene.TRAJECTORY].strips[0]), "twice as large, and turned"


def test_queues_stand_at_the_frame_of_the_moment() -> None:
    status = set_header(tessera.stage_status_t())
    status.name, status.queue = "mapper", 4
    bus = BusScene()
    bus.on_status(received(status))
    assert list(bus.motion()) == [], "no frame is known yet"
    bus.on_pose(make_pose_message(7, 0.0))
    bus.on_status(received(status))
    curve = by_path(bus.motion())[f"{scene.QUEUES}/mapper"]
    assert (curve.frames.tolist(), curve.values.tolist()) == ([7], [4])


def test_the_newest_image_is_shown_with_its_keypoints_once() -> None:
    bus = BusScene()
    bus.on_delta(make_delta(0, two_views()))
    features = set_header(tessera.features_t())
    features.keypoints = make_keypoints(12, [(320.0, 240.0), (100.0, 100.0)])
    bus.on_features(received(features))
    assert list(bus.pictures()) == [], "its pose is not there"
    bus.on_pose(make_pose_message(12, 0.0))
    shown = by_path(bus.pictures())
    assert is_close(shown[scene.TRACKED].positions, [[320, 240]])
    assert is_close(shown[scene.NEW].positions, [[100, 100]])
    assert list(bus.pictures()) == []


def make_occupancy(
    number: int,
    occupied: dict[tuple[int, int, int], list[int]],
    is_whole: bool = False,
    colors: list[tuple[int, int, int]] | None = None,
) -> Any:
    """Of each block, the numbers of the voxels that are occupied, in ascending order; the others are free."""
    message = set_header(tessera.occupancy_t())
    message.number, message.resolution, message.is_whole = number, 0.5, is_whole
    for (x, y, z), voxels in occupied.items():
        block = tessera.occupancy_block_t()
        states = np.full(4096, block.FREE, np.uint8)
        states[voxels] = block.OCCUPIED
        packed = np.bitwise_or.reduce([states[place::4] << 2 * place for place in range(4)])
        block.x, block.y, block.z, block.states = x, y, z, packed.astype(np.uint8).tobytes()
        message.blocks.append(block)
    message.num_blocks = len(message.blocks)
    for red, green, blue in colors or []:
        color = tessera.rgb_t()
        color.red, color.green, color.blue = red, green, blue
        message.colors.append(color)
    message.num_colors = len(message.colors)
    return received(message)


def voxels_of(shapes: Any) -> dict[str, list[list[float]]]:
    return {shape.path: sorted(shape.centers.tolist()) for shape in shapes}


def test_occupancy_is_shown_where_it_changed() -> None:
    occupancy = LiveOccupancy()
    occupancy.on_update(make_occupancy(0, {(0, 0, 0): [0, 17 + 256], (-1, 0, 9): [5]}, is_whole=True))
    assert not occupancy.lacks_whole
    shown = voxels_of(occupancy.shapes())
    assert shown == {
        f"{scene.VOXELS}/0_0_0": [[0.25, 0.25, 0.25], [0.75, 0.75, 0.75]],
        f"{scene.VOXELS}/-1_0_2": [[0.5 * (5.5 - 16), 0.25, 0.5 * (0.5 + 9 * 16)]],
    }
    assert list(occupancy.shapes()) == []
    occupancy.on_update(make_occupancy(1, {(0, 0, 0): []}))
    assert voxels_of(occupancy.shapes()) == {f"{scene.VOXELS}/0_0_0": []}, "what is free now is taken away"


def test_the_whole_occupancy_is_wanted_at_the_start_and_behind_a_gap() -> None:
    occupancy = LiveOccupancy()

    def lacks_whole_after(message: Any) -> bool:
        occupancy.on_update(message)
        return occupancy.lacks_whole

    assert lacks_whole_after(make_occupancy(6, {(0, 0, 0): [0]}))
    assert not lacks_whole_after(make_occupancy(7, {(8, 0, 0): [1]}, is_whole=True))
    assert voxels_of(occupancy.shapes())[f"{scene.VOXELS}/0_0_0"] == [], "it is not among the whole"
    assert not lacks_whole_after(make_occupancy(8, {(8, 0, 0): [2]}))
    assert lacks_whole_after(make_occupancy(10, {(8, 0, 0): [3]}))


def test_colors_are_chosen_anew_when_heights_grow() -> None:
    occupancy = LiveOccupancy()
    occupancy.on_update(make_occupancy(0, {(0, 0, 0): [0]}, is_whole=True))
    list(occupancy.shapes())
    occupancy.on_update(make_occupancy(1, {(0, -40, 0): [0]}))
    shown = by_path(occupancy.shapes())
    assert len(shown) == 2, "also the region that did not change"
    low, high = shown[f"{scene.VOXELS}/0_0_0"].colors[0], shown[f"{scene.VOXELS}/0_-10_0"].colors[0]
    assert low.tolist() == HEIGHT_COLORS[0].tolist() and high.tolist() == [250, 220, 120]


RED, BLACK, WHITE = (255, 0, 0), (0, 0, 0), (255, 255, 255)


def colors_at(shapes: Any) -> dict[tuple[float, ...], list[int]]:
    """By the centers of voxels."""
    return {
        tuple(center): color for shape in shapes for center, color in zip(shape.centers.tolist(), shape.colors.tolist())
    }


def test_occupied_voxels_have_the_colors_that_are_told_of_them() -> None:
    occupancy = LiveOccupancy()
    blocks: dict[tuple[int, int, int], list[int]] = {(0, 0, 0): [0, 1], (1, 0, 0): [], (9, 0, 0): [3]}
    occupancy.on_update(make_occupancy(0, blocks, is_whole=True, colors=[RED, BLACK, WHITE]))
    shown = colors_at(occupancy.shapes())
    red, black, white = shown[0.25, 0.25, 0.25], shown[0.75, 0.25, 0.25], shown[0.5 * (9 * 16 + 3.5), 0.25, 0.25]
    assert black == [DARKEST] * 3 and white == [255] * 3 and red[0] > red[1] == red[2]
    occupancy.on_update(make_occupancy(1, {(0, 0, 0): [1, 2]}, colors=[WHITE, BLACK]))
    shown = colors_at(occupancy.shapes())
    assert shown[0.75, 0.25, 0.25] == [255] * 3 and shown[1.25, 0.25, 0.25] == [DARKEST] * 3


def test_what_was_told_before_there_were_colors_turns_from_its_height_to_gray() -> None:
    occupancy = LiveOccupancy()
    occupancy.on_update(make_occupancy(0, {(0, 0, 0): [0]}, is_whole=True))
    assert colors_at(occupancy.shapes())[0.25, 0.25, 0.25] in HEIGHT_COLORS.tolist()
    occupancy.on_update(make_occupancy(1, {(9, 0, 0): [0, 1]}, colors=[BLACK, WHITE]))
    shown = colors_at(occupancy.shapes())
    red, green, blue = shown[0.25, 0.25, 0.25]
    assert len(shown) == 3 and DARKEST < red == green == blue < 255


def test_as_many_colors_as_voxels_or_none_count() -> None:
    occupancy = LiveOccupancy()
    occupancy.on_update(make_occupancy(0, {(0, 0, 0): [0, 1]}, is_whole=True, colors=[RED]))
    assert colors_at(occupancy.shapes())[0.25, 0.25, 0.25] in HEIGHT_COLORS.tolist()


def test_colors_spread_over_what_a_screen_shows() -> None:
    colors = seen_colors(np.arange(20, 60)[:, None].repeat(3, axis=1))
    assert colors[0].tolist() == [DARKEST] * 3 and colors[-1].tolist() == [255] * 3
    assert (np.diff(colors[:, 0].astype(int)) >= 0).all()
    assert seen_colors(np.empty((0, 3))).shape == (0, 3)
    red, gray = seen_colors(np.array([[200, 50, 50], [100, 100, 100]]))
    assert red[0] > red[1] == red[2] and gray.min() == gray.max(), "hues stay"


def make_band(frame: int, y: int, rows: int, value: int, image: int = 0) -> Any:
    message = set_header(tessera.camera_image_t())
    message.frame, message.width, message.height = frame, 4, 6
    band = message.band
    band.image, band.pixels.y, band.pixels.width, band.pixels.height = image, y, 4, rows
    band.data, band.num_bytes = bytes([value] * 4 * rows), 4 * rows
    return received(message)


def test_images_are_put_together_from_bands() -> None:
    images = LeftImages()
    assert images.add(make_band(3, 0, 4, 10)) is None
    assert images.add(make_band(3, 0, 6, 99, image=1)) is None, "the right image"
    image = images.add(make_band(3, 4, 2, 20))
    assert image is not None and image[:, 0].tolist() == [10, 10, 10, 10, 20, 20]
    images.add(make_band(4, 0, 4, 10))
    assert images.add(make_band(5, 4, 2, 20)) is None, "a band of another frame was lost"


def test_color_images_are_put_together_alike() -> None:
    message = set_header(tessera.color_image_t())
    message.frame, message.width, message.height = 3, 4, 6
    images = LeftImages(has_color=True)
    assert images.add(received(message)) is None, "the image is gray, which an empty one says"
    band = message.band
    band.encoding, band.pixels.width, band.pixels.height = band.RGB8, 4, 6
    band.data, band.num_bytes = bytes([1, 2, 3] * 24), 72
    image = images.add(received(message))
    assert image is not None and image.shape == (6, 4, 3) and image[5, 3].tolist() == [1, 2, 3]
    assert LeftImages().add(received(message)) is None, "gray images are expected"


def test_bands_that_leave_the_image_are_passed_over() -> None:
    assert LeftImages().add(make_band(3, 4, 4, 10)) is None


def test_the_size_of_the_image_comes_with_the_calibration() -> None:
    camera = set_header(tessera.calibration_t())
    camera.camera = make_camera()
    assert BusScene().image_size is None
    bus = BusScene()
    bus.on_calibration(received(camera))
    assert bus.image_size == (camera.camera.width, camera.camera.height)
    assert isinstance(by_path(bus.map_shapes())[scene.CAMERA], scene.Camera), "also without a map"
