"""A map as COLMAP's text model: cameras.txt, images.txt, points3D.txt, and the recorded images of keyframes.

    point_in_camera = rotation(QW QX QY QZ) * point_in_world + (TX TY TZ)

COLMAP counts pixels from the corner of the first one, and Tessera from its center: both differ by half a pixel. Numbers
are those of keyframes and landmarks, plus 1, since COLMAP counts from 1.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from tessera_cli.files import replacing, write_text
from tessera_cli.maps.camera_model import CameraModel
from tessera_cli.maps.landmark_colors import UNKNOWN, colors_at
from tessera_cli.maps.map_replica import Keyframe, MapReplica
from tessera_cli.maps.poses import conjugate, rotate, rotation_matrices
from tessera_cli.runs.recorded_images import best_images

# What a model's folder holds.
CAMERAS_FILE, IMAGES_FILE, POINTS_FILE, IMAGES = "cameras.txt", "images.txt", "points3D.txt", "images"
CONTENT = (CAMERAS_FILE, IMAGES_FILE, POINTS_FILE, IMAGES)

HALF_PIXEL = 0.5


@dataclass(frozen=True)
class Model:
    """What is exported: the largest part of the map, since others have worlds of their own."""

    keyframes: dict[int, Keyframe]
    cameras: list[CameraModel]
    landmarks: np.ndarray  # n numbers, ascending
    positions: np.ndarray  # n x 3
    tracks: list[np.ndarray]  # n, each k x 2: numbers of a keyframe and of its keypoint
    errors_px: np.ndarray  # n: means of the distances between keypoint and projection


def model_of(replica: MapReplica) -> Model:
    """Landmarks of one observer are left out."""
    parts = replica.parts()
    keyframes = {number: replica.keyframes[number] for number in (parts[0] if parts else [])}
    landmarks, observers, keypoints = replica.observations()
    is_inside = np.isin(observers, list(keyframes)) & np.isfinite(replica.positions[landmarks, 0])
    landmarks, observers, keypoints = landmarks[is_inside], observers[is_inside], keypoints[is_inside]
    numbers, inverse, counts = np.unique(landmarks, return_inverse=True, return_counts=True)
    order = np.argsort(inverse, kind="stable")
    pairs = np.stack([observers, keypoints], axis=1)[order]
    errors = reprojection_errors(replica, landmarks, observers, keypoints)
    means = np.bincount(inverse, errors, len(numbers)) / np.maximum(counts, 1)
    tracks = np.split(pairs, np.cumsum(counts)[:-1]) if len(numbers) else []
    is_kept = counts >= 2
    kept = [track for track, keep in zip(tracks, is_kept) if keep]
    cameras = sorted({keyframe.camera for keyframe in keyframes.values()}, key=repr)
    return Model(keyframes, cameras, numbers[is_kept], replica.positions[numbers[is_kept]], kept, means[is_kept])


def reprojection_errors(
    replica: MapReplica, landmarks: np.ndarray, observers: np.ndarray, keypoints: np.ndarray
) -> np.ndarray:
    """Px, of n observations: numbers of their landmarks, keyframes and keypoints."""
    errors = np.zeros(len(landmarks))
    for number in np.unique(observers).tolist():
        keyframe, rows = replica.keyframes[number], np.flatnonzero(observers == number)
        camera = keyframe.camera
        points = (replica.positions[landmarks[rows]] - keyframe.translation) @ _rotation(keyframe)
        seen = points[:, :2] / points[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
        errors[rows] = np.linalg.norm(seen - keyframe.keypoints[keypoints[rows]], axis=1)
    return errors


def image_name(keyframe: Keyframe) -> str:
    return f"frame_{keyframe.frame:06d}.png"


def write_model(model: Model, folder: Path, colors: np.ndarray | None) -> None:
    """Text files in `folder`. `colors`: n x 3 bytes, of the landmarks; None: not known."""
    write_text(folder / CAMERAS_FILE, "".join(_camera_rows(model)))
    write_text(folder / IMAGES_FILE, "".join(_image_rows(model)))
    values = np.full((len(model.landmarks), 3), UNKNOWN) if colors is None else colors
    write_text(folder / POINTS_FILE, "".join(_point_rows(model, values)))


def write_images(model: Model, folder: Path, log: Path, channel_prefix: str) -> np.ndarray:
    """The recorded images of the keyframes; returns the color of each landmark in the first of its images, n x 3."""
    by_frame = {keyframe.frame: number for number, keyframe in model.keyframes.items()}
    firsts = np.array([track[0] for track in model.tracks]).reshape(-1, 2)
    colors = np.full((len(model.landmarks), 3), UNKNOWN)
    for frame, _utime, image in best_images(log, channel_prefix, by_frame):
        number = by_frame[frame]
        keyframe = model.keyframes[number]
        with replacing(folder / image_name(keyframe)) as written:
            Image.fromarray(image).save(written)
        rows = np.flatnonzero(firsts[:, 0] == number)
        colors[rows] = colors_at(keyframe.camera.seen(keyframe.keypoints[firsts[rows, 1]]), image)
    return colors


def _rotation(keyframe: Keyframe) -> np.ndarray:
    """World from camera, 3 x 3."""
    return rotation_matrices(keyframe.rotation_wxyz)[0]


def _camera_rows(model: Model) -> Iterator[str]:
    yield "# CAMERA_ID MODEL WIDTH HEIGHT fx fy cx cy, of OPENCV also k1 k2 p1 p2\n"
    for index, camera in enumerate(model.cameras):
        numbers = [camera.fx, camera.fy, camera.cx + HALF_PIXEL, camera.cy + HALF_PIXEL, *_distortion(camera)]
        row = " ".join(f"{number:.9g}" for number in numbers)
        name = "OPENCV" if camera.radial else "PINHOLE"
        yield f"{index + 1} {name} {camera.width} {camera.height} {row}\n"


def _distortion(camera: CameraModel) -> tuple[float, ...]:
    """k1 k2 p1 p2 of images as the camera sees them; nothing where it sees as a pinhole does.

    CameraModel's correction, moved = (1 + a r^2) seen in units of the focal length, solved for `seen`:

        seen = (1 - a r^2 + 3 a^2 r^4 - ...) moved
    """
    a = camera.radial * (camera.fx / (0.5 * camera.width)) ** 2
    return (-a, 3.0 * a**2, 0.0, 0.0) if a else ()


def _image_rows(model: Model) -> Iterator[str]:
    yield "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of X Y POINT3D_ID for its keypoints\n"
    has_point = np.zeros(int(model.landmarks.max(initial=-1)) + 2, bool)
    has_point[model.landmarks] = True
    for number, keyframe in sorted(model.keyframes.items()):
        camera_from_world = conjugate(keyframe.rotation_wxyz)
        offset = -rotate(camera_from_world, keyframe.translation)
        pose = " ".join(f"{value:.12g}" for value in (*camera_from_world, *offset))
        camera = model.cameras.index(keyframe.camera) + 1
        yield f"{number + 1} {pose} {camera} {image_name(keyframe)}\n"
        known = np.minimum(keyframe.landmarks, len(has_point) - 1)
        points = np.where(has_point[known] & (keyframe.landmarks >= 0), keyframe.landmarks + 1, -1)
        pixels = keyframe.camera.seen(keyframe.keypoints) + HALF_PIXEL
        yield " ".join(f"{x:.8g} {y:.8g} {point}" for (x, y), point in zip(pixels.tolist(), points.tolist())) + "\n"


def _point_rows(model: Model, colors: np.ndarray) -> Iterator[str]:
    yield "# POINT3D_ID X Y Z R G B ERROR, then IMAGE_ID POINT2D_IDX of each observation\n"
    rows = zip(
        model.landmarks.tolist(), model.positions.tolist(), colors.tolist(), model.errors_px.tolist(), model.tracks
    )
    for number, (x, y, z), (red, green, blue), error, track in rows:
        seen = " ".join(f"{keyframe + 1} {keypoint}" for keyframe, keypoint in track.tolist())
        yield f"{number + 1} {x:.9g} {y:.9g} {z:.9g} {red} {green} {blue} {error:.6g} {seen}\n"
