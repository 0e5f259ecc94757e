"""The path of the camera while the map still changes: each pose moves along with its reference keyframe."""

from typing import Any

import numpy as np

from tessera_cli.maps.map_replica import MapReplica, Tie
from tessera_cli.maps.poses import multiply, rotate

# Removed keyframes whose parents were removed too, and so on.
MAX_CHAIN = 10_000
MIN_ALIGNED = 10


class LivePath:
    """Poses of tracked frames, and the truth of as many of them as came."""

    def __init__(self) -> None:
        self._poses: list[Any] = []  # pose_t
        self._truth: dict[int, np.ndarray] = {}  # by frame

    def add(self, pose: Any) -> None:
        if not self._poses or pose.frame > self._poses[-1].frame:
            self._poses.append(pose)

    def add_truth(self, message: Any) -> None:
        self._truth[message.frame] = message.world_from_camera.translation.astype(float)

    def newest(self, number: int) -> list[Any]:
        return self._poses[-number:]

    def positions(self, replica: MapReplica) -> np.ndarray:
        """N x 3, in the map as it is now. Where the keyframe is unknown, as it was published."""
        if not self._poses:
            return np.empty((0, 3))
        places = {number: _place(replica, number) for number in {pose.reference_keyframe for pose in self._poses}}
        path = np.array([pose.world_from_camera.translation for pose in self._poses], float)
        for number, place in places.items():
            if place is None:
                continue
            rows = [row for row, pose in enumerate(self._poses) if pose.reference_keyframe == number]
            rotation, translation, scale = place
            relative = np.array([self._poses[row].reference_from_camera.translation for row in rows], float)
            path[rows] = scale * rotate(rotation, relative) + translation
        return path

    def truth_in_map(self, replica: MapReplica, with_scale: bool) -> np.ndarray:
        """N x 3 of the true path, aligned to the estimate; empty before both are long enough for that."""
        from evo.core.geometry import GeometryException, umeyama_alignment

        known = [row for row, pose in enumerate(self._poses) if pose.frame in self._truth]
        if len(known) < MIN_ALIGNED:
            return np.empty((0, 3))
        truth = np.array([self._truth[self._poses[row].frame] for row in known])
        try:
            rotation, translation, scale = umeyama_alignment(truth.T, self.positions(replica)[known].T, with_scale)
        except GeometryException:
            return np.empty((0, 3))  # the camera has not moved yet
        return scale * truth @ rotation.T + translation


def _place(replica: MapReplica, number: int) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Rotation, translation and scale of a keyframe in the world, also of one that was removed; None: unknown."""
    chain: list[Tie] = []
    while number not in replica.keyframes:
        if number not in replica.removed or len(chain) > MAX_CHAIN:
            return None
        chain.append(replica.removed[number])
        number = chain[-1].parent
    keyframe = replica.keyframes[number]
    rotation, translation, scale = keyframe.rotation_wxyz, keyframe.translation, keyframe.scale
    for tie in reversed(chain):
        translation = scale * rotate(rotation, tie.translation) + translation
        rotation, scale = multiply(rotation, tie.rotation_wxyz), scale * tie.scale
    return rotation, translation, scale
