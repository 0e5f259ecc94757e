"""Files that hold the map are read as they were written, and damaged ones are refused in a sentence."""

import struct
from pathlib import Path

import lcm
import numpy as np
import pytest

from helpers.made_map import make_camera, set_header, two_views
from tessera_cli.errors import UserError
from tessera_cli.maps.map_file import read_map_file
from tessera_cli.maps.occupancy_file import DEFAULT_AXES, read_grid, read_voxels
from tessera_cli.messages import message_types as tessera

BT_HEADER = b"# Octomap OcTree binary file\n# a comment\nid OcTree\nsize 18\nres 0.5\ndata\n"
OT_HEADER = b"# Octomap OcTree file\n# a comment\n#\nid ColorOcTree\nsize 18\nres 0.5\ndata\n"
DEPTH = 16
INNER_FIRST, INNER_LAST, OCCUPIED_FIRST = 3, 3 << 14, 2


def write_map(path: Path, num_pages: int = 1, num_written: int = 1) -> Path:
    log = lcm.EventLog(str(path), "w", overwrite=True)
    header = set_header(tessera.map_file_t())
    header.version, header.num_pages, header.num_keyframes, header.num_landmarks = 1, num_pages, 2, 2
    header.camera = make_camera()
    log.write_event(0, "MAP_FILE", header.encode())
    for page in range(num_written):
        snapshot = set_header(tessera.map_snapshot_t())
        snapshot.page, snapshot.num_pages = page, num_pages
        if page == 0:
            snapshot.change = two_views()
        log.write_event(page + 1, "MAP_SNAPSHOT", snapshot.encode())
    log.close()
    return path


def test_a_map_is_read(tmp_path: Path) -> None:
    replica = read_map_file(write_map(tmp_path / "map.tessera", num_pages=2, num_written=2))
    assert sorted(replica.keyframes) == [0, 1]
    assert replica.landmark_ids().tolist() == [3, 5]
    assert replica.parts() == [[0, 1]]


def test_maps_that_are_none_or_damaged_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no such map"):
        read_map_file(tmp_path / "none.tessera")
    with pytest.raises(UserError, match="cut off"):
        read_map_file(write_map(tmp_path / "map.tessera", num_pages=3, num_written=2))
    (tmp_path / "text.tessera").write_text("no map")
    with pytest.raises(UserError, match="is no map"):
        read_map_file(tmp_path / "text.tessera")


def node(states: int) -> bytes:
    return bytes([states & 0xFF, states >> 8])


def test_occupied_voxels_stand_where_octomap_puts_them(tmp_path: Path) -> None:
    # The smallest voxel of the corner of the positive octant, reached by the lowest child of each node below.
    tree = node(INNER_LAST) + node(INNER_FIRST) * (DEPTH - 2) + node(OCCUPIED_FIRST)
    (tmp_path / "one.bt").write_bytes(BT_HEADER + tree)
    voxels = read_voxels(tmp_path / "one.bt")
    assert voxels.centers.tolist() == [[0.25, 0.25, 0.25]]
    assert voxels.sizes.tolist() == [0.5]
    (tmp_path / "cube.bt").write_bytes(BT_HEADER + tree[:-4] + node(OCCUPIED_FIRST))
    assert read_voxels(tmp_path / "cube.bt").sizes.tolist() == [1.0], "eight voxels that are pruned into one"


def color_node(log_odds: float, red: int, children: int) -> bytes:
    return struct.pack("<f4B", log_odds, red, 7, 9, children)


def test_colored_trees_have_colors_and_branches_follow_one_another(tmp_path: Path) -> None:
    # The last child of the root (the positive octant) and its first one down to the smallest voxels, of which two are
    # there; behind them the octant's last child, a leaf that is free.
    leaves = color_node(0.8, 90, 0) + color_node(1.5, 200, 0)
    inner = color_node(1.5, 0, 0b10000001) + color_node(1.5, 0, 1) * (DEPTH - 3) + color_node(1.5, 0, 0b11) + leaves
    tree = color_node(1.5, 0, 0b10000000) + inner + color_node(-0.4, 255, 0)
    (tmp_path / "one.ot").write_bytes(OT_HEADER + tree)
    voxels = read_voxels(tmp_path / "one.ot")
    assert voxels.centers.tolist() == [[0.25, 0.25, 0.25], [0.75, 0.25, 0.25]]
    assert voxels.colors is not None and voxels.colors.tolist() == [[90, 7, 9], [200, 7, 9]]
    for damaged in (tree[:-8], tree[:-3], tree + leaves):
        (tmp_path / "one.ot").write_bytes(OT_HEADER + damaged)
        with pytest.raises(UserError, match=r"one\.ot: is cut off"):
            read_voxels(tmp_path / "one.ot")


def test_a_tree_without_nodes_has_no_voxels(tmp_path: Path) -> None:
    for name, header in {"map.bt": BT_HEADER, "map.ot": OT_HEADER}.items():
        (tmp_path / name).write_bytes(header)
        assert len(read_voxels(tmp_path / name).sizes) == 0


@pytest.mark.parametrize("data", [b"", b"no tree", BT_HEADER + node(INNER_FIRST), BT_HEADER + node(INNER_FIRST) * 40])
def test_damaged_trees_are_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "map.bt").write_bytes(data)
    with pytest.raises(UserError, match=r"map\.bt: is"):
        read_voxels(tmp_path / "map.bt")


def write_grid(folder: Path, first_line: str = "") -> Path:
    (folder / "occupancy.pgm").write_bytes(b"P5\n2 3\n255\n" + bytes([0, 205, 254, 254, 205, 205]))
    path = folder / "occupancy.yaml"
    path.write_text(f"{first_line}image: occupancy.pgm\nresolution: 0.1\norigin: [-1.5, 2.0, 0.0]\n")
    return path


def test_a_grid_tells_where_its_plane_lies(tmp_path: Path) -> None:
    grid = read_grid(write_grid(tmp_path))
    assert grid.image.tolist() == [[0, 205], [254, 254], [205, 205]]
    assert np.array_equal(grid.axes, DEFAULT_AXES)
    line = "# The plane: x axis [0, 1, 0], y axis [-1, 0, 0], up [0, 0, 1]\n"
    assert read_grid(write_grid(tmp_path, line)).axes.tolist() == [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]


def test_grids_that_are_none_are_refused(tmp_path: Path) -> None:
    path = write_grid(tmp_path)
    (tmp_path / "occupancy.pgm").unlink()
    with pytest.raises(UserError, match=r"occupancy\.pgm"):
        read_grid(path)
    path.write_text("resolution: wide\n")
    with pytest.raises(UserError, match="no description of a grid"):
        read_grid(path)
