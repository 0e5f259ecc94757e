"""A picture of the occupancy map, as seen over the shoulder of the camera where it saw most."""

import base64
import io
from html import escape

import numpy as np
from PIL import Image

from tessera_cli.maps.colors import voxel_colors
from tessera_cli.maps.occupancy_file import Voxels, read_voxels
from tessera_cli.report.drawing import Drawing
from tessera_cli.report.viewpoint import SIGHT, over_the_shoulder
from tessera_cli.runs.run_folder import Result
from tessera_cli.runs.trajectories import Trajectory

WIDTH, HEIGHT = 1200, 800
FOCAL_PX = WIDTH / 2 / SIGHT[0]
BACKGROUND = (24, 27, 32)  # on light pages as well as on dark ones
# Of what faces up or down, to the sides, and along the view: edges are seen by it.
SHADES = (1.0, 0.72, 0.86)
# Samples of a face along each of its edges, for each pixel that the edge is long; and at most.
SAMPLES_PER_PX, MAX_SAMPLES = 1.3, 64
JPEG_QUALITY = 85


def draw_voxels(result: Result) -> Drawing | None:
    """None where the run has no occupancy map, or an empty one."""
    if result.voxel_tree is None or result.estimate is None:
        return None
    voxels = read_voxels(result.voxel_tree)
    if not len(voxels.sizes):
        return None
    edge = f"{voxels.resolution:.3g} {'m' if result.summary.get('sensor') != 'mono' else 'map units'}"
    label = f"Occupied space, {len(voxels.sizes)} cubes of {edge}, seen from behind the camera."
    note = (
        f"The voxels of the occupancy map ({edge}), seen from behind and above the camera where it saw most of them; "
        f"their color is {'their height' if voxels.colors is None else 'what the images show there'}."
    )
    picture = base64.b64encode(_to_jpeg(picture_of(voxels, result.estimate))).decode()
    svg = (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(label)}" '
        f'xmlns="http://www.w3.org/2000/svg"><image width="{WIDTH}" height="{HEIGHT}" '
        f'href="data:image/jpeg;base64,{picture}" /></svg>'
    )
    return Drawing("Occupied space", label, note, svg, is_hero=True)


def picture_of(voxels: Voxels, trajectory: Trajectory) -> np.ndarray:
    """HEIGHT x WIDTH x 3 bytes. There must be a voxel and a pose."""
    view = over_the_shoulder(voxels.centers, trajectory)
    in_eye = (voxels.centers - view.eye) @ view.world_from_eye
    is_seen = in_eye[:, 2] > view.nearest
    return _render(in_eye[is_seen], voxels.sizes[is_seen], voxel_colors(voxels)[is_seen], view.world_from_eye)


def _pixels(in_eye: np.ndarray) -> np.ndarray:
    """N x 2 of n x 3 points in front of the eye; of others, anything."""
    depth = np.maximum(in_eye[:, 2:], 1e-9)
    return FOCAL_PX * in_eye[:, :2] / depth + [WIDTH / 2, HEIGHT / 2]


def _is_inside(pixels: np.ndarray) -> np.ndarray:
    return np.all((pixels >= 0) & (pixels < [WIDTH, HEIGHT]), axis=1)


def _render(centers: np.ndarray, sizes: np.ndarray, colors: np.ndarray, world_from_eye: np.ndarray) -> np.ndarray:
    """Each face that looks at the eye as so many points that they leave no gap; the nearest in a pixel is seen."""
    depths = np.full(HEIGHT * WIDTH, np.inf)
    picture = np.tile(np.array(BACKGROUND, np.uint8), (HEIGHT * WIDTH, 1))
    axes = world_from_eye  # row i: the world's axis i as the eye sees it
    # The axis that is most upright, most across and most along the view.
    shades = [SHADES[int(np.argmax(np.abs(axis[[1, 0, 2]])))] for axis in axes]
    for i, axis in enumerate(axes):
        toward = -np.sign(centers @ axis)
        faces = centers + (toward * sizes / 2)[:, None] * axis
        is_visible = (np.abs(centers @ axis) > sizes / 2) & (faces[:, 2] > 0)
        across, along = axes[(i + 1) % 3], axes[(i + 2) % 3]
        shaded = (shades[i] * colors).astype(np.uint8)
        samples = np.ceil(SAMPLES_PER_PX * FOCAL_PX * sizes / np.maximum(faces[:, 2], 1e-9))
        samples = np.clip(samples, 1, MAX_SAMPLES).astype(int)
        for num in np.unique(samples[is_visible]):
            rows = np.flatnonzero(is_visible & (samples == num))
            steps = (np.arange(num) + 0.5) / num - 0.5
            offsets = (steps[:, None, None] * across + steps[None, :, None] * along).reshape(-1, 3)
            points = (faces[rows, None] + sizes[rows, None, None] * offsets).reshape(-1, 3)
            _draw_points(points, np.repeat(shaded[rows], num * num, axis=0), depths, picture)
    return picture.reshape(HEIGHT, WIDTH, 3)


def _draw_points(points: np.ndarray, colors: np.ndarray, depths: np.ndarray, picture: np.ndarray) -> None:
    pixels = _pixels(points)
    is_inside = (points[:, 2] > 0) & _is_inside(pixels)
    at, depth = pixels[is_inside].astype(int) @ [1, WIDTH], points[is_inside, 2]
    np.minimum.at(depths, at, depth)
    is_nearest = depth <= depths[at]
    picture[at[is_nearest]] = colors[is_inside][is_nearest]


def _to_jpeg(picture: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=JPEG_QUALITY)
    return buffer.getvalue()
