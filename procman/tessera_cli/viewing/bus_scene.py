"""A running stack as a scene: messages of the bus are passed in, and from time to time what they show comes out.

It knows no bus and no clock. What many messages tell is shown together, since a viewer takes in few large values in
less time than many small ones.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from tessera_cli.maps.camera_model import CameraModel
from tessera_cli.maps.landmark_colors import LandmarkColors
from tessera_cli.maps.map_follower import MapFollower, PartJoiner
from tessera_cli.messages import pose_t
from tessera_cli.runs.recorded_images import LeftImages, to_jpeg
from tessera_cli.viewing import keypoints, map_shapes
from tessera_cli.viewing.live_occupancy import LiveOccupancy
from tessera_cli.viewing.live_path import LivePath
from tessera_cli.viewing.scene import (
    CAMERA,
    CAMERA_SIZE,
    GRAY,
    HERE,
    IMAGE,
    INLIERS,
    LATENCY,
    QUEUES,
    TILES,
    TRAJECTORY,
    TRUTH,
    YELLOW,
    Camera,
    Lines,
    Moment,
    Picture,
    Points,
    Poses,
    Series,
    Shown,
)

# Frames whose image or features wait for their pose; and keyframes whose landmarks the next frame may show.
MAX_WAITING = 16
NUM_NEIGHBORS = 12


class BusScene:
    """Call the method of each message's channel; `motion`, `map_shapes` and `pictures` when there is time for them."""

    def __init__(self) -> None:
        self.follower = MapFollower()
        self.occupancy = LiveOccupancy()
        self.has_occupancy_stage = False
        self._path = LivePath()
        self._camera: CameraModel | None = None
        self._grid = (1, 1)
        self._start_us: int | None = None
        self._moment: Moment | None = None  # of the last frame
        self._images = LeftImages()
        self._color_images = LeftImages(has_color=True)
        self._colors = LandmarkColors()
        self._waiting_images: dict[int, np.ndarray] = {}
        self._waiting_features: dict[int, list[Any]] = {}  # keypoints_t, the parts of a frame
        self._joiner = PartJoiner(MAX_WAITING)
        self._curves: dict[str, list[tuple[Moment, float]]] = {}  # that are not shown yet, by path
        self._placed: list[tuple[Moment, Any]] = []  # poses of tracked frames that are not shown yet
        self._pictured = -1  # the last frame whose image was shown
        self._tracked = np.empty(0, int)  # landmarks in that image
        self._map_changed = False
        self._shown_camera: tuple[Any, ...] = ()

    def on_calibration(self, message: Any) -> None:
        """A calibration_t."""
        self._camera = CameraModel.of(message.camera)

    def on_pose(self, message: Any) -> None:
        """A pose_t."""
        moment = self._moment_of(message.frame, message.utime)
        self._add_to_curve(f"{INLIERS}/matches", moment, message.num_matches)
        self._add_to_curve(f"{INLIERS}/inliers", moment, message.num_inliers)
        self._add_to_curve(f"{LATENCY}/latency", moment, 1e-3 * message.latency)
        self._add_to_curve(f"{LATENCY}/map_wait", moment, 1e-3 * message.map_wait_us)
        if message.state == pose_t.TRACKED:
            self._path.add(message)
            self._placed.append((moment, message.world_from_camera))

    def on_truth(self, message: Any) -> None:
        """A ground_truth_t."""
        self._path.add_truth(message)

    def on_status(self, message: Any) -> None:
        """A stage_status_t."""
        if message.name == "dispatcher":
            values = dict(zip(message.value_names, message.values))
            self._grid = (int(values.get("tile_lines", 1)), int(values.get("tile_columns", 1)))
        self.has_occupancy_stage |= message.name == "occupancy"
        if self._moment:
            self._add_to_curve(f"{QUEUES}/{message.name}", self._moment, message.queue)

    def on_features(self, message: Any) -> None:
        """A features_t."""
        if self._camera is None:
            self._camera = CameraModel.of(message.keypoints.camera)  # the calibration was sent before we listened
        parts = self._joiner.add(message.keypoints.frame, message)
        if parts is not None:
            _keep(self._waiting_features, message.keypoints.frame, [part.keypoints for part in parts])

    def on_image(self, message: Any) -> None:
        """A camera_image_t."""
        image = self._images.add(message)
        if image is not None:
            _keep(self._waiting_images, message.frame, image)

    def on_color(self, message: Any) -> None:
        """A color_image_t."""
        image = self._color_images.add(message)
        if image is not None:
            self._colors.add(message.frame, image)
            self._map_changed = True

    def on_delta(self, message: Any) -> None:
        """A map_delta_t."""
        self._map_changed |= self.follower.on_delta(message)

    def on_page(self, message: Any) -> None:
        """A map_snapshot_t."""
        self._map_changed |= self.follower.on_page(message)

    def on_occupancy(self, message: Any) -> None:
        """An occupancy_t."""
        self.occupancy.on_update(message)

    @property
    def image_size(self) -> tuple[int, int] | None:
        """Width and height in pixels, once they are known."""
        return (self._camera.width, self._camera.height) if self._camera else None

    def motion(self) -> Iterator[Shown]:
        """Where the camera was, and the curves, since the last call."""
        for path, points in self._curves.items():
            yield Series(path, *_times_of(points), np.array([value for _, value in points], float))
        self._curves.clear()
        if not self._placed:
            return
        positions = np.array([placed.translation for _, placed in self._placed], float)
        rotations_wxyz = np.array([placed.rotation_wxyz for _, placed in self._placed], float)
        yield Poses(CAMERA, *_times_of(self._placed), positions, np.roll(rotations_wxyz, -1, axis=1))
        yield Points(HERE, positions[-1:], YELLOW, 4.0, self._placed[-1][0])
        self._placed.clear()

    def map_shapes(self) -> Iterator[Shown]:
        """The map as it is now, if it changed, and the paths in it."""
        replica = self.follower.replica
        if self._map_changed:
            self._map_changed = False
            yield from map_shapes.shapes_of(replica, self._colors.of(replica))
        yield from self._camera_shape(map_shapes.frustum_depth(replica))
        path = self._path.positions(replica)
        yield Lines(TRAJECTORY, [path] if len(path) > 1 else [], YELLOW, 2.0)
        truth = self._path.truth_in_map(replica, self._camera is None or self._camera.is_mono)
        if len(truth) > 1:
            yield Lines(TRUTH, [truth], GRAY, 2.0)
        yield from self.occupancy.shapes()

    def pictures(self) -> Iterator[Shown]:
        """The newest image that was placed and not shown yet, with its keypoints."""
        poses = {pose.frame: pose for pose in self._path.newest(MAX_WAITING)}
        frames = [frame for frame in self._waiting_features if frame in poses and frame > self._pictured]
        if not frames:
            return
        # Without images, keypoints alone.
        with_image = [frame for frame in frames if frame in self._waiting_images]
        frame = max(with_image or frames)
        self._pictured = frame
        pose, features = poses[frame], self._waiting_features[frame]
        moment = self._moment_of(frame, pose.utime)
        if with_image:
            yield Picture(IMAGE, to_jpeg(self._waiting_images[frame]), moment)
        found = self._classify(features, pose)
        self._tracked = found.landmarks
        yield from keypoints.shapes_of(found, moment)

    def _classify(self, features: list[Any], pose: Any) -> keypoints.Keypoints:
        replica = self.follower.replica
        newest = sorted(replica.keyframes)[-NUM_NEIGHBORS:]
        near = {*newest, pose.reference_keyframe} & replica.keyframes.keys()
        seen = [replica.keyframes[number].landmarks for number in sorted(near)]
        candidates = np.unique(np.concatenate([np.empty(0, int), *seen]))
        candidates = candidates[candidates >= 0]
        placed = pose.world_from_camera
        return keypoints.of_frame(
            np.concatenate([np.stack([part.x, part.y], axis=1) for part in features]).astype(np.float32),
            np.concatenate([part.descriptors["bits"] for part in features]),
            CameraModel.of(features[0].camera),
            (placed.rotation_wxyz.astype(float), placed.translation.astype(float)),
            replica,
            candidates,
            self._tracked,
        )

    def _camera_shape(self, depth: float) -> Iterator[Shown]:
        if self._camera is None or (self._camera, self._grid, depth) == self._shown_camera:
            return
        self._shown_camera = (self._camera, self._grid, depth)
        yield Camera(CAMERA, self._camera, CAMERA_SIZE * depth)
        if borders := keypoints.tile_borders(*self._grid, self._camera.width, self._camera.height):
            yield Lines(TILES, borders, YELLOW, 1.0)

    def _add_to_curve(self, path: str, moment: Moment, value: float) -> None:
        self._curves.setdefault(path, []).append((moment, value))

    def _moment_of(self, frame: int, utime_us: int) -> Moment:
        if self._start_us is None:
            self._start_us = utime_us
        moment = Moment(frame, 1e-6 * (utime_us - self._start_us))
        if self._moment is None or frame > self._moment.frame:
            self._moment = moment
        return moment


def _times_of(entries: list[tuple[Moment, Any]]) -> tuple[np.ndarray, np.ndarray]:
    """Frames and seconds."""
    return np.array([moment.frame for moment, _ in entries]), np.array([moment.seconds for moment, _ in entries])


def _keep(waiting: dict[int, Any], frame: int, value: Any) -> None:
    """The newest of them only."""
    waiting[frame] = value
    while len(waiting) > MAX_WAITING:
        del waiting[next(iter(waiting))]
