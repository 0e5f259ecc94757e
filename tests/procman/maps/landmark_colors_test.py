"""What landmarks look like in map.ply, and in the color images of a running stack."""

from pathlib import Path

import numpy as np

from helpers.made_map import make_delta, two_views
from tessera_cli.maps.landmark_colors import UNKNOWN, VERTEX, LandmarkColors, colors_at, read_colors
from tessera_cli.maps.map_replica import MapReplica

HEADER = (
    b"ply\nformat binary_little_endian 1.0\ncomment landmarks of Tessera\nelement vertex 2\n"
    + b"".join(b"property float %s\n" % name for name in (b"x", b"y", b"z", b"nx", b"ny", b"nz"))
    + b"property int observations\n"
)
COLORS = b"property uchar red\nproperty uchar green\nproperty uchar blue\n"
END = b"end_header\n"


def made_replica() -> MapReplica:
    replica = MapReplica()
    replica.apply(make_delta(0, two_views()).change)
    return replica


def test_colors_of_a_run_are_those_of_its_file(tmp_path: Path) -> None:
    vertices = np.zeros(2, VERTEX)
    vertices["rgb"] = [[1, 2, 3], [4, 5, 6]]
    path, replica = tmp_path / "map.ply", made_replica()
    assert read_colors(tmp_path, replica) is None, "there is no file"
    path.write_bytes(HEADER + COLORS + END + vertices.tobytes())
    colors = read_colors(tmp_path, replica)
    assert colors is not None and colors.tolist() == [[1, 2, 3], [4, 5, 6]]
    path.write_bytes(HEADER + COLORS + END + vertices.tobytes()[:-1])
    assert read_colors(tmp_path, replica) is None, "it is cut off"
    path.write_bytes(HEADER + END + bytes(2 * (VERTEX.itemsize - 3)))
    assert read_colors(tmp_path, replica) is None, "it has no colors"


def test_a_pixel_is_around_its_center() -> None:
    image = np.zeros((2, 2, 3), np.uint8)
    image[1, 0] = [7, 8, 9]
    assert colors_at(np.array([[0.4, 0.6], [-9.0, 9.0], [0.6, 0.6]]), image).tolist() == [[7, 8, 9]] * 2 + [[0] * 3]
    assert colors_at(np.array([[0.0, 1.0]]), image[:, :, 2]).tolist() == [[9, 9, 9]], "of a gray image"


def test_a_landmark_has_the_mean_color_of_its_observers() -> None:
    colors, replica = LandmarkColors(), made_replica()
    frames = {number: keyframe.frame for number, keyframe in replica.keyframes.items()}
    assert colors.of(replica) is None
    colors.add(frames[0], np.full((480, 640, 3), [100, 0, 50], np.uint8))
    first = colors.of(replica)
    assert first is not None and first.tolist() == [[100, 0, 50], [UNKNOWN] * 3], "only keyframe 1 sees landmark 5"
    colors.add(frames[1], np.full((480, 640, 3), [200, 20, 50], np.uint8))
    both = colors.of(replica)
    assert both is not None and both.tolist() == [[150, 10, 50], [200, 20, 50]]
