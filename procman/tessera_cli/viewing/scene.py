"""What the viewer shows, as values: where something stands in the tree of entities, when, and what it looks like.

The world is that of the map (its first camera: x right, y down, z forward), in meters (mono: units of the map). A
value without a moment holds for all times and replaces the one before it.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from tessera_cli.maps.camera_model import CameraModel

Color: TypeAlias = tuple[int, int, int]

# --- Where things stand -------------------------------------------------------------------------------------------
WORLD = "world"
TRUTH, TRAJECTORY = f"{WORLD}/truth", f"{WORLD}/trajectory"
KEYFRAMES, COVISIBILITY, LOOPS = f"{WORLD}/keyframes", f"{WORLD}/covisibility", f"{WORLD}/loops"
LOOP_ENDS = f"{LOOPS}/ends"
LANDMARKS = f"{WORLD}/landmarks"
VOXELS, FLOOR = f"{WORLD}/occupancy/voxels", f"{WORLD}/occupancy/grid"
CAMERA = f"{WORLD}/camera"
HERE = f"{WORLD}/here"  # where the camera is: the eye follows it
IMAGE = f"{CAMERA}/image"
TILES, TRACKED, NEW, LOST = (f"{IMAGE}/{name}" for name in ("tiles", "tracked", "new", "lost"))
LATENCY, QUEUES, INLIERS, ERROR = "latency_ms", "queue", "keypoints", "error_m"

# --- What they look like ------------------------------------------------------------------------------------------
GRAY: Color = (150, 150, 150)
BLUE: Color = (75, 150, 255)
GREEN: Color = (70, 200, 90)
RED: Color = (235, 70, 60)
YELLOW: Color = (240, 190, 60)
FAINT: Color = (60, 95, 70)


# Of curves; those that are not named here get one from the viewer.
CURVE_COLORS: dict[str, Color] = {
    f"{INLIERS}/matches": YELLOW,
    f"{INLIERS}/inliers": GREEN,
    f"{LATENCY}/latency": RED,
    f"{LATENCY}/map_wait": YELLOW,
    f"{LATENCY}/pose_time": BLUE,
    f"{ERROR}/position": YELLOW,
}


@dataclass(frozen=True)
class Moment:
    frame: int
    seconds: float  # in the source, since its first frame


@dataclass(frozen=True)
class Points:
    """In the world (n x 3), or in the image (n x 2, px)."""

    path: str
    positions: np.ndarray
    colors: Color | np.ndarray  # one, or n x 3
    width_px: float  # on the screen
    moment: Moment | None = None


@dataclass(frozen=True)
class PointSeries:
    """Points in the images of n frames."""

    path: str
    frames: np.ndarray
    seconds: np.ndarray
    positions: list[np.ndarray]  # n, each k x 2, px
    color: Color
    width_px: float


@dataclass(frozen=True)
class Lines:
    """Each an n x 3 of the world, or an n x 2 of the image."""

    path: str
    strips: list[np.ndarray] | np.ndarray
    color: Color
    width_px: float
    moment: Moment | None = None


# Of the current camera, in depths of keyframes.
CAMERA_SIZE = 2.0


@dataclass(frozen=True)
class Camera:
    """The camera as a frustum of this depth."""

    path: str
    model: CameraModel
    depth: float


@dataclass(frozen=True)
class Poses:
    """world_from_camera of n frames."""

    path: str
    frames: np.ndarray
    seconds: np.ndarray
    translations: np.ndarray  # n x 3
    quaternions_xyzw: np.ndarray  # n x 4


@dataclass(frozen=True)
class Series:
    """A number of n frames; NaN leaves a gap."""

    path: str
    frames: np.ndarray
    seconds: np.ndarray
    values: np.ndarray


@dataclass(frozen=True)
class Picture:
    path: str
    jpeg: bytes
    moment: Moment


@dataclass(frozen=True)
class Voxels:
    """Cubes of the world."""

    path: str
    centers: np.ndarray  # n x 3
    sizes: np.ndarray  # n, the sides
    colors: Color | np.ndarray


@dataclass(frozen=True)
class Floor:
    """A grid of cells seen from above: pixel (row, column) is the cell at corner + right * column + down * row."""

    path: str
    image: np.ndarray  # rows x columns, gray
    corner: np.ndarray  # 3, of pixel (0, 0)
    right: np.ndarray  # 3, from one column to the next
    down: np.ndarray  # 3, from one row to the next


Shown: TypeAlias = Points | PointSeries | Lines | Camera | Poses | Series | Picture | Voxels | Floor


# A plot: where its curves stand, and its title.
INLIERS_PLOT, LATENCY_PLOT = (INLIERS, "matches and inliers"), (LATENCY, "latency [ms]")
QUEUES_PLOT, ERROR_PLOT = (QUEUES, "queue lengths"), (ERROR, "distance from the truth [m]")


@dataclass(frozen=True)
class Look:
    """Which plots there are, how large the image is, and from where the world is seen first."""

    plots: tuple[tuple[str, str], ...]
    image_size: tuple[int, int] | None = None  # width and height, px; None: not known yet
    eye: np.ndarray | None = None  # None: it follows the camera
    target: np.ndarray | None = None
