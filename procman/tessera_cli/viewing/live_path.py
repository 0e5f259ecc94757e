"""The path of the camera while the map still changes: each pose moves along with its reference keyframe."""

from collections import deque
from typing import Any

import numpy as np

from tessera_cli.maps.map_replica import MapReplica, Tie
from tessera_cli.maps.poses import multiply, rotate, rotation_matrices

# Removed keyframes whose parents were removed too, and so on.
MAX_CHAIN = 10_000
MIN_ALIGNED = 10
# Poses that are kept whole.
MAX_NEWEST = 32
NOWHERE = (np.array([1.0, 0, 0, 0]), np.zeros(3), 1.0)


class LivePath:
    """Poses of tracked frames, and the truth of as many of them as came."""

    def __init__(self) -> None:
        self._frames: list[int] = []
        self._references: list[int] = []  # numbers of their reference keyframes
        self._in_reference: list[np.ndarray] = []  # positions relative to these
        self._published: list[np.ndarray] = []  # positions in the world as it was then
        self._newest: deque[Any] = deque(maxlen=MAX_NEWEST)  # pose_t
        self._truth: dict[int, np.ndarray] = {}  # by frame

    def add(self, pose: Any) -> None:
        if self._frames and pose.frame <= self._frames[-1]:
            return
        self._frames.append(pose.frame)
        self._references.append(pose.reference_keyframe)
        self._in_reference.append(pose.reference_from_camera.translation)
        self._published.append(pose.world_from_camera.translation)
        self._newest.append(pose)

    def add_truth(self, message: Any) -> None:
        self._truth[message.frame] = message.world_from_camera.translation.astype(float)

    def newest(self, number: int) -> list[Any]:
        """At most MAX_NEWEST."""
        return list(self._newest)[-number:]

    def positions(self, replica: MapReplica) -> np.ndarray:
        """N x 3, in the map as it is now. Where the keyframe is unknown, as it was published."""
        if not self._frames:
            return np.empty((0, 3))
        numbers, which = np.unique(self._references, return_inverse=True)
        places = [_place(replica, number) for number in numbers.tolist()]
        is_known = np.array([place is not None for place in places])[which]
        rotations, translations, scales = zip(*(place or NOWHERE for place in places))
        turned = np.einsum("nij,nj->ni", rotation_matrices(np.array(rotations))[which], np.array(self._in_reference))
        moved = np.array(scales)[which, None] * turned + np.array(translations)[which]
        return np.where(is_known[:, None], moved, np.array(self._published))

    def truth_in_map(self, replica: MapReplica, with_scale: bool) -> np.ndarray:
        """N x 3 of the true path, aligned to the estimate; empty before both are long enough for that."""
        from evo.core.geometry import GeometryException, umeyama_alignment

        known = [row for row, frame in enumerate(self._frames) if frame in self._truth]
        if len(known) < MIN_ALIGNED:
            return np.empty((0, 3))
        truth = np.array([self._truth[self._frames[row]] for row in known])
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
