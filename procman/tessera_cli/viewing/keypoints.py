"""Which keypoints of an image are tracked, which are new, and which landmarks were lost.

Tracked: the keypoint shows a landmark of the map. New: it shows none yet. Lost: a landmark that the image before
showed, drawn where it should be seen in this one.
"""

from dataclasses import dataclass

import numpy as np

from tessera_cli.maps.camera_model import CameraModel
from tessera_cli.maps.map_replica import Keyframe, MapReplica
from tessera_cli.maps.poses import rotation_matrices
from tessera_cli.viewing.scene import BLUE, GREEN, LOST, NEW, RED, TRACKED, Moment, Points, PointSeries, Shown

# A keypoint shows a landmark that should be seen so near, and looks so much like it (bits of 256 that differ).
MAX_DISTANCE_PX = 4.0
MAX_BITS = 64
# Widths on the screen.
NEW_PX, LOST_PX, TRACKED_PX = 1.2, 1.8, 2.0


@dataclass(frozen=True)
class Keypoints:
    """Of one image."""

    tracked: np.ndarray  # n x 2, px
    new: np.ndarray  # m x 2
    lost: np.ndarray  # k x 2
    landmarks: np.ndarray  # n: numbers of those that are tracked


def project(camera: CameraModel, rotation_wxyz: np.ndarray, translation: np.ndarray, points: np.ndarray) -> np.ndarray:
    """N x 2 px of n x 3 points in the world, seen from world_from_camera; NaN outside of the image."""
    in_camera = (points - translation) @ rotation_matrices(rotation_wxyz)[0]
    depth = np.where(in_camera[:, 2] > 0, in_camera[:, 2], np.nan)
    pixels = np.stack(
        [camera.fx * in_camera[:, 0] / depth + camera.cx, camera.fy * in_camera[:, 1] / depth + camera.cy], axis=1
    )
    is_inside = (pixels >= -0.5).all(axis=1) & (pixels[:, 0] < camera.width) & (pixels[:, 1] < camera.height)
    return np.where(is_inside[:, None], pixels, np.nan)


def of_keyframe(keyframe: Keyframe, replica: MapReplica, before: np.ndarray) -> Keypoints:
    """As the map says. `before`: numbers of the landmarks that the keyframe before shows."""
    is_tracked = keyframe.landmarks >= 0
    landmarks = keyframe.landmarks[is_tracked]
    lost = _lost(before, landmarks, replica, keyframe.camera, keyframe.rotation_wxyz, keyframe.translation)
    return Keypoints(keyframe.keypoints[is_tracked], keyframe.keypoints[~is_tracked], lost, landmarks)


def of_frame(
    pixels: np.ndarray,
    descriptors: np.ndarray,
    camera: CameraModel,
    pose: tuple[np.ndarray, np.ndarray],
    replica: MapReplica,
    candidates: np.ndarray,
    before: np.ndarray,
) -> Keypoints:
    """Found by projection, as the tracker does; it does not tell which landmarks it used.

    `pixels` n x 2 and `descriptors` n x 32 of the frame, `pose` its world_from_camera (w x y z, translation),
    `candidates` numbers of landmarks that may be seen, `before` those that the frame before showed.
    """
    seen_at = project(camera, *pose, replica.positions[candidates])
    is_seen = np.isfinite(seen_at[:, 0])
    candidates, seen_at = candidates[is_seen], seen_at[is_seen].astype(np.float32)
    apart = np.abs(pixels[:, None, 0] - seen_at[None, :, 0]) + np.abs(pixels[:, None, 1] - seen_at[None, :, 1])
    keypoints, columns = np.nonzero(apart < MAX_DISTANCE_PX)
    bits = np.bitwise_count(descriptors[keypoints] ^ replica.descriptors[candidates[columns]]).sum(axis=1)
    order = np.argsort(bits, kind="stable")
    order = order[bits[order] <= MAX_BITS]
    # Each keypoint and each landmark once, the most alike first.
    order = order[np.sort(np.unique(keypoints[order], return_index=True)[1])]
    order = order[np.sort(np.unique(columns[order], return_index=True)[1])]
    landmarks = candidates[columns[order]]
    is_tracked = np.zeros(len(pixels), bool)
    is_tracked[keypoints[order]] = True
    lost = _lost(before, landmarks, replica, camera, *pose)
    return Keypoints(pixels[keypoints[order]], pixels[~is_tracked], lost, landmarks)


def _lost(
    before: np.ndarray,
    now: np.ndarray,
    replica: MapReplica,
    camera: CameraModel,
    rotation_wxyz: np.ndarray,
    translation: np.ndarray,
) -> np.ndarray:
    missing = np.setdiff1d(before, now)
    missing = missing[missing < len(replica.positions)]
    pixels = project(camera, rotation_wxyz, translation, replica.positions[missing])
    return pixels[np.isfinite(pixels[:, 0])]


def shapes_of(keypoints: Keypoints, moment: Moment) -> list[Shown]:
    """Of one image."""
    return [
        Points(NEW, keypoints.new, BLUE, NEW_PX, moment),
        Points(LOST, keypoints.lost, RED, LOST_PX, moment),
        Points(TRACKED, keypoints.tracked, GREEN, TRACKED_PX, moment),
    ]


def series_of(keypoints: list[Keypoints], moments: list[Moment]) -> list[Shown]:
    """Of several."""
    frames = np.array([moment.frame for moment in moments])
    seconds = np.array([moment.seconds for moment in moments])
    return [
        PointSeries(NEW, frames, seconds, [found.new for found in keypoints], BLUE, NEW_PX),
        PointSeries(LOST, frames, seconds, [found.lost for found in keypoints], RED, LOST_PX),
        PointSeries(TRACKED, frames, seconds, [found.tracked for found in keypoints], GREEN, TRACKED_PX),
    ]


def tile_borders(lines: int, columns: int, width: int, height: int) -> list[np.ndarray]:
    """The inner borders of the grid into which images are cut (modules/features/tiling.cc), each 2 x 2 px."""
    upright = [width * column // columns for column in range(1, columns)]
    level = [height * line // lines for line in range(1, lines)]
    strips = [[[x - 0.5, -0.5], [x - 0.5, height - 0.5]] for x in upright]
    strips += [[[-0.5, y - 0.5], [width - 0.5, y - 0.5]] for y in level]
    return [np.array(strip) for strip in strips]
