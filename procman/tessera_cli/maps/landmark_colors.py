"""What landmarks look like: as map.ply of a run tells, or as the color images of a running stack show them."""

import re
from pathlib import Path

import numpy as np

from tessera_cli.maps.map_replica import MapReplica

UNKNOWN = 128
# Of map.ply (modules/evaluation/map_ply.h); without those of color where none is known.
VERTEX = np.dtype([("position", "<f4", 3), ("normal", "<f4", 3), ("observations", "<i4"), ("rgb", "u1", 3)])
PROPERTIES = b"x y z nx ny nz observations red green blue".split()


def read_colors(folder: Path, replica: MapReplica) -> np.ndarray | None:
    """N x 3 bytes of the landmarks of a run's map, in the order of their numbers; None: they are not known."""
    try:
        header, _, data = (folder / "map.ply").read_bytes().partition(b"end_header\n")
    except OSError:
        return None
    count = len(replica.landmark_ids())
    has_color = re.findall(rb"^property \w+ (\w+)$", header, re.MULTILINE) == PROPERTIES
    if not has_color or len(data) != count * VERTEX.itemsize:
        return None
    return np.frombuffer(data, VERTEX)["rgb"]


def colors_at(pixels: np.ndarray, image: np.ndarray) -> np.ndarray:
    """N x 3 bytes of the nearest pixels of n x 2 px, in an image of height x width (x 3)."""
    columns, lines = pixels.round().astype(int).T
    colors = image[lines.clip(0, image.shape[0] - 1), columns.clip(0, image.shape[1] - 1)]
    return colors if colors.ndim == 2 else np.repeat(colors[:, None], 3, axis=1)


class LandmarkColors:
    """Of a running stack: the mean over the keyframes that observe a landmark, as far as their images were heard."""

    MAX_WAITING = 16  # images whose keyframes are not in the map yet

    def __init__(self) -> None:
        self._waiting: dict[int, np.ndarray] = {}  # images by frame
        self._at_keypoints: dict[int, np.ndarray] = {}  # by number of the keyframe, n x 3

    def add(self, frame: int, image: np.ndarray) -> None:
        """The color image of a keyframe."""
        self._waiting[frame] = image
        while len(self._waiting) > self.MAX_WAITING:
            del self._waiting[next(iter(self._waiting))]

    def of(self, replica: MapReplica) -> np.ndarray | None:
        """N x 3 bytes of the landmarks, in the order of their numbers; None: none is known."""
        for number, keyframe in replica.keyframes.items():
            if self._waiting and keyframe.frame in self._waiting:
                pixels = keyframe.camera.seen(keyframe.keypoints)
                self._at_keypoints[number] = colors_at(pixels, self._waiting.pop(keyframe.frame))
        known = self._at_keypoints.keys() & replica.keyframes.keys()
        if not known:
            return None
        sums, counts = np.zeros((len(replica.positions), 3)), np.zeros(len(replica.positions), int)
        for number in sorted(known):
            landmarks = replica.keyframes[number].landmarks
            is_seen = landmarks >= 0
            np.add.at(sums, landmarks[is_seen], self._at_keypoints[number][is_seen])
            np.add.at(counts, landmarks[is_seen], 1)
        means = np.where(counts[:, None] > 0, sums / np.maximum(counts, 1)[:, None], UNKNOWN)
        return means[replica.landmark_ids()].round().astype(np.uint8)
