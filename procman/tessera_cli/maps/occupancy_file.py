"""The occupancy map of a run: the trees of OctoMap (occupancy.ot, .bt), and the grid of ROS (occupancy.yaml, .pgm)."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from PIL import Image

from tessera_cli.errors import UserError

TREE_DEPTH = 16
# Of the eight halves of a cube, in the order of a node's children: 1 is the upper half along x, y, z.
HALVES = np.array([[child & 1, child >> 1 & 1, child >> 2] for child in range(8)])
# Two bits for each child of a node of the binary tree, the first child in the lowest ones: 0 unknown, 1 free,
# 2 occupied, 3 it has children.
OCCUPIED, INNER = 2, 3
# A node of the colored tree: log-odds (occupied if not negative), color, a bit for each child that it has.
COLOR_NODE = np.dtype([("log_odds", "<f4"), ("rgb", "u1", 3), ("children", "u1")])
UNKNOWN_GRAY = 205
# Where the file does not say otherwise: x right, y forward and up against gravity, of a camera that is held upright.
DEFAULT_AXES = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


@dataclass(frozen=True)
class Voxels:
    """Those that are occupied; a cube of several is told as one."""

    centers: np.ndarray  # n x 3
    sizes: np.ndarray  # n, the sides
    resolution: float  # side of the smallest
    colors: np.ndarray | None = None  # n x 3 bytes: the mean of what the images show there; None: not known


@dataclass(frozen=True)
class Grid:
    """Seen from above. `image` has the row of the highest y first; 0 occupied, 254 free, 205 unknown."""

    image: np.ndarray  # rows x columns
    resolution: float  # side of a cell
    origin: np.ndarray  # 2, x and y of the lower left corner of the last row's first cell
    axes: np.ndarray  # 3 x 3: the grid's x axis, its y axis, and up, as rows, in the world of the map


def read_voxels(path: Path) -> Voxels:
    """Of a `.bt` file, or of an `.ot` file with colors. Raises UserError if it is none, or damaged."""
    header, found, data = _read_bytes(path).partition(b"\ndata\n")
    resolution = re.search(rb"^res ([0-9.eE+-]+)$", header, re.MULTILINE)
    is_binary = header.startswith(b"# Octomap OcTree binary file")
    is_colored = header.startswith(b"# Octomap OcTree file") and b"\nid ColorOcTree\n" in header
    if not (is_binary or is_colored) or not found or not resolution:
        raise UserError(f"{path}: is no tree of OctoMap, or damaged: make the map again.")
    try:
        cubes, colors = _binary_cubes(data) if is_binary else _color_cubes(data)
        edge = float(resolution[1])
    except ValueError as error:
        raise UserError(f"{path}: is cut off or damaged: copy it again, or make the map again.") from error
    half_width = 1 << (TREE_DEPTH - 1)
    centers = (cubes[:, :3] + cubes[:, 3:] / 2 - half_width) * edge
    return Voxels(centers, cubes[:, 3] * edge, edge, colors)


def _binary_cubes(data: bytes) -> tuple[np.ndarray, None]:
    """The occupied cubes as `_cubes` tells them. Of nodes without children, there are only the two bits."""
    nodes = np.frombuffer(data, "<u2")
    states = nodes[:, None] >> 2 * np.arange(8) & 3
    cubes = _cubes(states == INNER)
    nodes_of, children = np.nonzero(states == OCCUPIED)
    half = cubes[nodes_of, 3:] // 2
    return np.hstack([cubes[nodes_of, :3] + half * HALVES[children], half]), None


def _color_cubes(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Likewise, and their colors."""
    nodes = np.frombuffer(data, COLOR_NODE)
    cubes = _cubes((nodes["children"][:, None] >> np.arange(8) & 1).astype(bool))
    is_occupied = (nodes["children"] == 0) & (nodes["log_odds"] >= 0)
    return cubes[is_occupied], nodes["rgb"][is_occupied]


def _cubes(has_child: np.ndarray) -> np.ndarray:
    """N x 4: lowest corner and side of each node's cube, in voxels from the corner of the whole tree.

    `has_child`: n x 8, of nodes that are followed by their children, each with all that belongs to it before the next.
    Raises ValueError if these are not the nodes of one tree.
    """
    num_nodes = len(has_child)
    cubes = np.zeros((num_nodes, 4), int)
    if num_nodes == 0:
        return cubes
    num_children = has_child.sum(axis=1)
    # How many children are announced and still to come behind each node; where it falls below what it was before a
    # node came, the tree of that node ends.
    num_open = np.cumsum(num_children - 1) + 1
    if num_open[-1] != 0 or not num_open[:-1].all():
        raise ValueError("nodes are missing or left over")
    numbers = np.arange(num_nodes)
    ordered = np.sort(num_open * num_nodes + numbers)
    ends = ordered[np.searchsorted(ordered, (num_open - num_children) * num_nodes + numbers)] % num_nodes + 1
    parents, size = np.zeros(1, int), 1 << TREE_DEPTH
    cubes[0, 3] = size
    while len(parents):
        size //= 2
        following, level = parents + 1, []
        for child in range(8):
            rows = np.flatnonzero(has_child[parents, child])
            nodes = following[rows]
            cubes[nodes, :3] = cubes[parents[rows], :3] + size * HALVES[child]
            cubes[nodes, 3] = size
            following[rows] = ends[nodes]
            level.append(nodes)
        parents = np.concatenate(level)
        if size == 0 and len(parents):
            raise ValueError("deeper than a tree can be")
    return cubes


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
