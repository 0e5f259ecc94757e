"""The occupancy map of a run: the binary tree of OctoMap (occupancy.bt), and the grid of ROS (occupancy.yaml, .pgm)."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from PIL import Image

from tessera_cli.errors import UserError

TREE_DEPTH = 16
# Two bits for each child of a node, the first child in the lowest ones: 0 unknown, 1 free, 2 occupied, 3 it has
# children.
OCCUPIED, INNER = 2, 3
UNKNOWN_GRAY = 205
# Where the file does not say otherwise: x right, y forward and up against gravity, of a camera that is held upright.
DEFAULT_AXES = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


@dataclass(frozen=True)
class Voxels:
    """Those that are occupied; a cube of several is told as one."""

    centers: np.ndarray  # n x 3
    sizes: np.ndarray  # n, the sides


@dataclass(frozen=True)
class Grid:
    """Seen from above. `image` has the row of the highest y first; 0 occupied, 254 free, 205 unknown."""

    image: np.ndarray  # rows x columns
    resolution: float  # side of a cell
    origin: np.ndarray  # 2, x and y of the lower left corner of the last row's first cell
    axes: np.ndarray  # 3 x 3: the grid's x axis, its y axis, and up, as rows, in the world of the map


def read_voxels(path: Path) -> Voxels:
    """Of a `.bt` file. Raises UserError if it is none, or damaged."""
    data = _read_bytes(path)
    header, found, tree = data.partition(b"\ndata\n")
    resolution = re.search(rb"^res ([0-9.eE+-]+)$", header, re.MULTILINE)
    if not header.startswith(b"# Octomap OcTree binary file") or not found or not resolution:
        raise UserError(f"{path}: is no binary tree of OctoMap, or damaged: make the map again.")
    try:
        cells = np.array(_occupied_cells(tree), np.int64).reshape(-1, 4)
    except IndexError as error:
        raise UserError(f"{path}: is cut off: copy it again, or make the map again.") from error
    edge = float(resolution[1])
    half_width = 1 << (TREE_DEPTH - 1)
    return Voxels((cells[:, :3] + cells[:, 3:] / 2 - half_width) * edge, cells[:, 3] * edge)


def _occupied_cells(tree: bytes) -> list[tuple[int, int, int, int]]:
    """Lowest corner and side of each occupied cube, in voxels from the corner of the whole tree.

    A node is two bytes; its children's nodes follow it, each with all that belongs to it before the next.
    """
    cells: list[tuple[int, int, int, int]] = []
    stack, at = [(0, 0, 0, 1 << TREE_DEPTH)] if tree else [], 0
    while stack:
        x, y, z, size = stack.pop()
        states, half = tree[at] | tree[at + 1] << 8, size >> 1
        at += 2
        if half == 0:
            raise IndexError("deeper than a tree can be")
        inner: list[tuple[int, int, int, int]] = []
        for child in range(8):
            state = states >> 2 * child & 3
            if state < OCCUPIED:
                continue
            cube = (x + half * (child & 1), y + half * (child >> 1 & 1), z + half * (child >> 2), half)
            (cells if state == OCCUPIED else inner).append(cube)
        stack += reversed(inner)
    return cells


def read_grid(path: Path) -> Grid:
    """Of a `.yaml` file, and of the image that it names. Raises UserError if they are none."""
    try:
        text = path.read_text()
        described = yaml.safe_load(text)
        resolution, origin = float(described["resolution"]), np.array(described["origin"][:2], float)
        image_path = path.with_name(str(described["image"]))
        with Image.open(image_path) as image:
            pixels = np.asarray(image.convert("L"))
    except OSError as error:
        raise UserError(f"{error.filename or path}: can't be read ({error.strerror or error}).") from error
    except (KeyError, TypeError, ValueError, yaml.YAMLError) as error:
        raise UserError(f"{path}: is no description of a grid, as ROS reads it ({error}).") from error
    return Grid(pixels, resolution, origin, _axes_in(text))


def _axes_in(text: str) -> np.ndarray:
    """The comment of the file tells where the grid's plane lies."""
    axes = [re.search(rf"{name} \[([^\]]*)\]", text) for name in ("x axis", "y axis", "up")]
    if not all(axes):
        return DEFAULT_AXES
    return np.array([[float(number) for number in axis[1].split(",")] for axis in axes if axis])


def _read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: can't be read ({error.strerror}).") from error
