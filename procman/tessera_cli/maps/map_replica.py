"""A copy of the map: what MAP_DELTA and the pages of MAP_SNAPSHOT change, applied in order.

The C++ processes have the same in modules/map, with a hash that proves it equal to the mapper's. This one is for
looking and for export: of descriptors it keeps those of landmarks, and a message that refers to what it does not know
raises MapError.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tessera_cli.maps.camera_model import CameraModel
from tessera_cli.maps.poses import conjugate, multiply, rotate

# More landmarks than any map has: a number beyond is damage.
MAX_LANDMARKS = 1 << 26
MAX_KEYPOINTS = 1 << 20
DESCRIPTOR_BYTES = 32


class MapError(Exception):
    """A change does not fit the map."""


@dataclass
class Keyframe:
    parent: int  # -1: none
    rotation_wxyz: np.ndarray  # world_from_camera
    translation: np.ndarray
    scale: float  # mono: units of the map to one of those in which poses relative to it are told
    frame: int
    utime_us: int
    camera: CameraModel
    keypoints: np.ndarray  # n x 2, px, as the camera model has them
    levels: np.ndarray  # n, of the pyramid
    landmarks: np.ndarray  # n: number of the landmark that the keypoint shows; -1: none


@dataclass(frozen=True)
class Tie:
    """Where a keyframe that is no longer in the map stood, relative to its parent, in the parent's units."""

    parent: int
    rotation_wxyz: np.ndarray  # parent_from_keyframe
    translation: np.ndarray
    scale: float  # the keyframe's units in the parent's


@dataclass(frozen=True)
class ClosedLoop:
    current: int  # numbers of keyframes
    matched: int
    num_points: int


@dataclass
class MapReplica:
    keyframes: dict[int, Keyframe] = field(default_factory=dict)
    removed: dict[int, Tie] = field(default_factory=dict)  # keyframes that this copy has seen go
    loops: list[ClosedLoop] = field(default_factory=list)
    # By number of the landmark; NaN: there is none.
    positions: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    descriptors: np.ndarray = field(default_factory=lambda: np.empty((0, DESCRIPTOR_BYTES), np.uint8))

    def landmark_ids(self) -> np.ndarray:
        return np.flatnonzero(np.isfinite(self.positions[:, 0]))

    def observations(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Landmark, keyframe and keypoint of each, ordered by keyframe and keypoint."""
        parts = [
            (keyframe.landmarks[seen], np.full(len(seen), number), seen)
            for number, keyframe in sorted(self.keyframes.items())
            if len(seen := np.flatnonzero(keyframe.landmarks >= 0))
        ]
        if not parts:
            return (np.empty(0, int),) * 3
        landmarks, keyframes, keypoints = (np.concatenate(columns) for columns in zip(*parts))
        return landmarks, keyframes, keypoints

    def parts(self) -> list[list[int]]:
        """Numbers of the keyframes that are connected by the spanning tree; the part with the most keyframes first."""
        parts: dict[int, list[int]] = {}
        root_of: dict[int, int] = {}
        for number in sorted(self.keyframes):
            chain = [number]
            while chain[-1] not in root_of and self.keyframes[chain[-1]].parent in self.keyframes:
                chain.append(self.keyframes[chain[-1]].parent)
                if len(chain) > len(self.keyframes):
                    raise MapError("the parents of keyframes go around in a circle")
            root = root_of.get(chain[-1], chain[-1])
            root_of.update(dict.fromkeys(chain, root))
            parts.setdefault(root, []).append(number)
        return sorted(parts.values(), key=lambda part: (-len(part), part[0]))

    def apply(self, change: Any) -> None:
        """A map_change_t as `decode_arrays` gives it. Parts of one change are applied one after another."""
        if change.fx:
            self._change_lens(change.fx, change.fy, change.radial)
        for added in change.new_keyframes:
            self._add_keyframe(added)
        moved = zip(change.moved_keyframes.tolist(), change.world_from_camera, change.scale.tolist())
        for number, pose, scale in moved:
            keyframe = self._keyframe(number)
            keyframe.rotation_wxyz = pose["rotation_wxyz"].astype(float)
            keyframe.translation = pose["translation"].astype(float)
            keyframe.scale = scale
        self._place_landmarks(change.landmarks)
        self._observe(change.removed_observations, is_new=False)
        self._observe(change.new_observations, is_new=True)
        for child, parent in zip(change.children.tolist(), change.parents.tolist()):
            self._keyframe(child).parent = parent
        self._remove_landmarks(change.removed_landmarks.astype(int))
        for number in change.removed_keyframes.tolist():
            self._remove_keyframe(number)
        for loop in change.closed_loops:
            self.loops.append(ClosedLoop(int(loop["current"]), int(loop["matched"]), int(loop["num_points"])))

    def _keyframe(self, number: int) -> Keyframe:
        keyframe = self.keyframes.get(number)
        if keyframe is None:
            raise MapError(f"keyframe {number} is not in the map")
        return keyframe

    def _change_lens(self, fx: float, fy: float, radial: float) -> None:
        for keyframe in self.keyframes.values():
            camera = keyframe.camera.with_lens(fx, fy, radial)
            if camera.radial != keyframe.camera.radial:
                keyframe.keypoints = camera.moved(keyframe.camera.seen(keyframe.keypoints)).astype(np.float32)
            keyframe.camera = camera

    def _add_keyframe(self, added: Any) -> None:
        """A map_keyframe_t: a keyframe, or more of its keypoints."""
        keypoints = added.keypoints
        if not 0 <= keypoints.first <= keypoints.first + keypoints.num_keypoints <= keypoints.num_total:
            raise MapError(f"the keypoints of keyframe {added.keyframe} are out of range")
        if keypoints.num_total > MAX_KEYPOINTS:
            raise MapError(f"keyframe {added.keyframe} has too many keypoints")
        if added.keyframe not in self.keyframes:
            pose, total = added.world_from_camera, keypoints.num_total
            self.keyframes[added.keyframe] = Keyframe(
                parent=added.parent,
                rotation_wxyz=pose.rotation_wxyz.astype(float),
                translation=pose.translation.astype(float),
                scale=added.scale,
                frame=keypoints.frame,
                utime_us=keypoints.utime,
                camera=CameraModel.of(keypoints.camera, keypoints.radial),
                keypoints=np.zeros((total, 2), np.float32),
                levels=np.zeros(total, np.uint8),
                landmarks=np.full(total, -1),
            )
        keyframe, end = self.keyframes[added.keyframe], keypoints.first + keypoints.num_keypoints
        if len(keyframe.keypoints) != keypoints.num_total:
            raise MapError(f"the parts of keyframe {added.keyframe} do not fit")
        keyframe.keypoints[keypoints.first : end] = np.stack([keypoints.x, keypoints.y], axis=1)
        keyframe.levels[keypoints.first : end] = keypoints.level

    def _place_landmarks(self, landmarks: np.ndarray) -> None:
        """Structured as map_landmark_t."""
        if not len(landmarks):
            return
        numbers = landmarks["landmark"].astype(int)
        if numbers.min() < 0 or numbers.max() >= MAX_LANDMARKS:
            raise MapError("the number of a landmark is out of range")
        if numbers.max() >= len(self.positions):
            # Twice as many as needed, so that the arrays seldom move.
            num_more = 2 * int(numbers.max()) + 2 - len(self.positions)
            self.positions = np.pad(self.positions, ((0, num_more), (0, 0)), constant_values=np.nan)
            self.descriptors = np.pad(self.descriptors, ((0, num_more), (0, 0)))
        self.positions[numbers] = landmarks["position_in_world"]
        self.descriptors[numbers] = landmarks["descriptor"]["bits"]

    def _remove_landmarks(self, numbers: np.ndarray) -> None:
        if len(numbers) and (numbers.min() < 0 or numbers.max() >= len(self.positions)):
            raise MapError("a landmark that is to be removed is not in the map")
        self.positions[numbers] = np.nan

    def _observe(self, observations: np.ndarray, is_new: bool) -> None:
        """Structured as map_observation_t."""
        if not len(observations):
            return
        keyframes = observations["keyframe"].astype(int)
        order = np.argsort(keyframes, kind="stable")
        numbers, begins = np.unique(keyframes[order], return_index=True)
        for number, rows in zip(numbers.tolist(), np.split(order, begins[1:])):
            keyframe, keypoints = self._keyframe(number), observations["keypoint"][rows].astype(int)
            if keypoints.min() < 0 or keypoints.max() >= len(keyframe.landmarks):
                raise MapError(f"an observation names a keypoint that keyframe {number} does not have")
            keyframe.landmarks[keypoints] = observations["landmark"][rows] if is_new else -1

    def _remove_keyframe(self, number: int) -> None:
        keyframe = self._keyframe(number)
        parent = self.keyframes.get(keyframe.parent)
        if parent is not None:
            parent_from_world = conjugate(parent.rotation_wxyz)
            offset = rotate(parent_from_world, keyframe.translation - parent.translation)
            self.removed[number] = Tie(
                keyframe.parent,
                multiply(parent_from_world, keyframe.rotation_wxyz),
                offset / parent.scale,
                keyframe.scale / parent.scale,
            )
        del self.keyframes[number]
