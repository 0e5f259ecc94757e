"""A made KITTI sequence: a camera moves through a textured room, and its poses are known exactly.

World and camera axes: x right, y down, z forward; meters.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

WIDTH_PX, HEIGHT_PX = 480, 320
FOCAL_PX = 300.0
CENTER_PX = (239.5, 159.5)
BASELINE_M = 0.3
FRAME_PERIOD_S = 0.05
# The walls, and a pillar's front and sides, so that no single plane fills the view: axis, position on it, and the
# range along the two other axes in which the wall stands.
ROOM_LOW = np.array([-7.0, -2.0, -3.0])
ROOM_HIGH = np.array([7.0, 2.0, 9.0])
PILLAR_LOW = np.array([-0.6, -2.0, 5.0])
PILLAR_HIGH = np.array([0.6, 2.0, 6.2])
TEXELS_PER_M = 60
TEXTURE_SIZE = 1024

# What the walls of make_walls() are painted with, where they are in color: shares of red, green and blue, in tenths.
PAINTS = [(10, 4, 4), (4, 10, 4), (4, 4, 10), (10, 10, 3), (3, 10, 10)]
PAINTS += [(10, 3, 10), (10, 6, 2), (2, 6, 10), (6, 10, 2), (9, 9, 9)]
TINTS = 0.1 * np.array(PAINTS)  # walls x 3


@dataclass(frozen=True)
class Wall:
    axis: int
    position_m: float
    low: np.ndarray
    high: np.ndarray
    texture: np.ndarray


def make_texture(generator: np.random.Generator) -> np.ndarray:
    """Random squares of several sizes on top of each other: corners at every scale. TEXTURE_SIZE^2, repeats."""
    texture = np.zeros((TEXTURE_SIZE, TEXTURE_SIZE))
    for cell, weight in ((128, 0.3), (32, 0.35), (8, 0.35)):
        squares = generator.random((TEXTURE_SIZE // cell, TEXTURE_SIZE // cell))
        texture += weight * np.kron(squares, np.ones((cell, cell)))
    # A slight blur keeps distant texels from flickering between frames.
    for axis in (0, 1):
        texture = (np.roll(texture, 1, axis) + 2 * texture + np.roll(texture, -1, axis)) / 4
    return 255 * (texture - texture.min()) / np.ptp(texture)


def make_walls() -> list[Wall]:
    generator = np.random.default_rng(2)
    walls = [
        Wall(axis, bound[axis], ROOM_LOW, ROOM_HIGH, make_texture(generator))
        for axis in range(3)
        for bound in (ROOM_LOW, ROOM_HIGH)
    ]
    walls += [
        Wall(axis, bound[axis], PILLAR_LOW, PILLAR_HIGH, make_texture(generator))
        for axis in (0, 2)
        for bound in (PILLAR_LOW, PILLAR_HIGH)
    ]
    return walls


def sample(texture: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Bilinear, repeating."""
    left, top = np.floor(u).astype(int), np.floor(v).astype(int)
    du, dv = u - left, v - top
    columns, rows = (left % TEXTURE_SIZE, (left + 1) % TEXTURE_SIZE), (top % TEXTURE_SIZE, (top + 1) % TEXTURE_SIZE)
    return (1 - dv) * ((1 - du) * texture[rows[0], columns[0]] + du * texture[rows[0], columns[1]]) + dv * (
        (1 - du) * texture[rows[1], columns[0]] + du * texture[rows[1], columns[1]]
    )


def render(walls: list[Wall], world_from_camera: np.ndarray) -> np.ndarray:
    """The image at a pose (3x4), HEIGHT_PX x WIDTH_PX bytes: the nearest wall along each pixel's ray."""
    x, y = np.meshgrid(np.arange(WIDTH_PX), np.arange(HEIGHT_PX))
    rays = np.stack([(x - CENTER_PX[0]) / FOCAL_PX, (y - CENTER_PX[1]) / FOCAL_PX, np.ones_like(x, float)], axis=-1)
    rays = rays @ world_from_camera[:, :3].T
    origin = world_from_camera[:, 3]
    nearest = np.full(x.shape, np.inf)
    image = np.zeros(x.shape)
    for wall in walls:
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = (wall.position_m - origin[wall.axis]) / rays[..., wall.axis]
            points = origin + depth[..., None] * rays
        others = [axis for axis in range(3) if axis != wall.axis]
        inside = np.all(
            [(points[..., axis] >= wall.low[axis]) & (points[..., axis] <= wall.high[axis]) for axis in others], axis=0
        )
        seen = inside & (depth > 0.05) & (depth < nearest)
        nearest[seen] = depth[seen]
        u, v = (points[seen][:, axis] * TEXELS_PER_M for axis in others)
        image[seen] = sample(wall.texture, u, v)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def render_in_color(walls: list[Wall], world_from_camera: np.ndarray) -> np.ndarray:
    """Likewise, with painted walls: HEIGHT_PX x WIDTH_PX x 3."""
    numbered = [replace(wall, texture=np.full_like(wall.texture, number)) for number, wall in enumerate(walls)]
    paint = TINTS[render(numbered, world_from_camera)]
    return np.round(paint * render(walls, world_from_camera)[..., None]).astype(np.uint8)


def pose_at(frame: int) -> np.ndarray:
    """world_from_camera, 3x4: sideways and forward in a bow, turning a little."""
    yaw = 0.15 * np.sin(0.04 * frame)
    rotation = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    position = [-2.0 + 0.05 * frame, 0.2 * np.sin(0.07 * frame), -0.5 + 0.02 * frame]
    return np.column_stack([rotation, position])


def write_image(path: Path, image: np.ndarray) -> None:
    """As PGM, or in color as PPM; `path` has no ending."""
    kind, ending = ("P5", ".pgm") if image.ndim == 2 else ("P6", ".ppm")
    header = f"{kind} {image.shape[1]} {image.shape[0]} 255\n"
    path.with_suffix(ending).write_bytes(header.encode() + image.tobytes())


def write_sequence(folder: Path, num_frames: int, with_color: bool = False) -> Path:
    """The sequence in KITTI's layout, as a stereo pair, with poses.txt inside. Returns the folder."""
    walls = make_walls()
    draw = render_in_color if with_color else render
    right_from_left = np.array([BASELINE_M, 0.0, 0.0])
    for camera in ("image_0", "image_1"):
        (folder / camera).mkdir(parents=True)
    poses = [pose_at(frame) for frame in range(num_frames)]
    for frame, pose in enumerate(poses):
        right_pose = np.column_stack([pose[:, :3], pose[:, 3] + pose[:, :3] @ right_from_left])
        write_image(folder / "image_0" / f"{frame:06d}", draw(walls, pose))
        write_image(folder / "image_1" / f"{frame:06d}", draw(walls, right_pose))
    left = f"{FOCAL_PX} 0 {CENTER_PX[0]} {{}} 0 {FOCAL_PX} {CENTER_PX[1]} 0 0 0 1 0"
    (folder / "calib.txt").write_text(f"P0: {left.format(0)}\nP1: {left.format(-FOCAL_PX * BASELINE_M)}\n")
    (folder / "times.txt").write_text("".join(f"{FRAME_PERIOD_S * frame:.6f}\n" for frame in range(num_frames)))
    (folder / "poses.txt").write_text(
        "".join(" ".join(f"{value:.9f}" for value in pose.ravel()) + "\n" for pose in poses)
    )
    return folder
