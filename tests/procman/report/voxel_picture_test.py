"""The picture of the occupancy map in a report."""

from pathlib import Path

import numpy as np

from helpers.made_run import write_run
from tessera_cli.maps.occupancy_file import Voxels
from tessera_cli.report.html_report import write_report
from tessera_cli.report.voxel_picture import BACKGROUND, HEIGHT, WIDTH, picture_of
from tessera_cli.runs.run_folder import read_run
from tessera_cli.runs.trajectories import Trajectory

# One voxel of 1 m in the positive octant.
ONE_VOXEL = b"# Octomap OcTree binary file\n#\nid OcTree\nsize 17\nres 1\ndata\n\0\xc0" + b"\3\0" * 14 + b"\2\0"


def camera_at(position: list[float]) -> Trajectory:
    """One pose, looking along z."""
    return Trajectory(np.zeros(1), np.array([position]), np.array([[0.0, 0, 0, 1]]), has_times=True)


def test_voxels_stand_where_the_eye_sees_them_and_near_ones_hide_far_ones() -> None:
    centers = np.array([[-2.0, 0, 10], [2.0, 0, 10], [-2.4, 0, 12]])
    voxels = Voxels(centers, np.ones(3), 1.0, np.repeat([[255], [0], [0]], 3, axis=1))
    picture = picture_of(voxels, camera_at([0, 0, 0])).astype(int)
    is_drawn = (picture != BACKGROUND).any(axis=2)
    assert is_drawn[:, : WIDTH // 2].any() and is_drawn[:, WIDTH // 2 :].any()
    rows = np.nonzero(is_drawn)[0]
    assert rows.min() > HEIGHT * 0.3 and rows.max() < HEIGHT * 0.7
    left = picture[:, : WIDTH // 2][is_drawn[:, : WIDTH // 2]]
    assert (left.mean(axis=1) > 150).mean() > 0.7, "the bright one stands in front"
    assert picture[:, WIDTH // 2 :][is_drawn[:, WIDTH // 2 :]].max() < 60


def test_faces_leave_no_gap() -> None:
    x, y = np.meshgrid(np.arange(-60, 60), np.arange(-60, 60))
    wall = np.stack([x.ravel(), y.ravel(), np.full(x.size, 24)], axis=1) + 0.5
    picture = picture_of(Voxels(wall, np.ones(len(wall)), 1.0, None), camera_at([0, 0, 0]))
    assert not (picture == BACKGROUND).all(axis=2).any()


def test_a_report_has_the_picture_where_the_run_has_an_occupancy_map(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    write_report([read_run(folder)], tmp_path / "without.html")
    assert "Occupied space" not in (tmp_path / "without.html").read_text()
    (folder / "occupancy.bt").write_bytes(ONE_VOXEL)
    write_report([read_run(folder)], tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text()
    assert "Occupied space" in text and "data:image/jpeg;base64," in text
