"""Reading of trajectory files, and the error against ground truth."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tessera_cli.errors import UserError
from tessera_cli.runs.trajectories import Trajectory, absolute_error, read_trajectory


def make_path(num_poses: int = 50) -> Trajectory:
    t = np.linspace(0.0, 5.0, num_poses)
    positions = np.column_stack([np.cos(t), np.sin(2 * t), 0.3 * t])
    return Trajectory(t, positions, Rotation.from_euler("y", t[:, None]).as_quat(), has_times=True)


def moved(path: Trajectory, scale: float) -> Trajectory:
    """The same path in another world frame and another unit."""
    turn = Rotation.from_euler("xyz", [0.3, -1.0, 2.0])
    return Trajectory(
        path.timestamps_s,
        scale * turn.apply(path.positions) + [5.0, -3.0, 1.0],
        (turn * Rotation.from_quat(path.quaternions_xyzw)).as_quat(),
        path.has_times,
    )


@pytest.mark.parametrize("scale, with_scale", [(1.0, False), (1.0, True), (0.2, True)])
def test_alignment_takes_the_world_frame_away(scale: float, with_scale: bool) -> None:
    error = absolute_error(moved(make_path(), scale), make_path(), with_scale)
    assert error.rms_m < 1e-9
    assert error.scale == pytest.approx(1.0 / scale)


def test_scale_is_kept_by_se3() -> None:
    error = absolute_error(moved(make_path(), 0.2), make_path(), with_scale=False)
    assert error.scale == 1.0
    assert error.rms_m > 0.1


def test_only_poses_with_a_truth_count() -> None:
    truth = make_path()
    chosen = slice(10, 40, 3)
    poses = (truth.timestamps_s[chosen], truth.positions[chosen], truth.quaternions_xyzw[chosen])
    some = Trajectory(*poses, has_times=True)
    error = absolute_error(some, truth, with_scale=False)
    assert len(error.errors_m) == 10
    assert error.rms_m < 1e-9


def test_known_noise_is_measured() -> None:
    truth = make_path()
    noise = np.random.default_rng(1).normal(0.0, 0.01, truth.positions.shape)
    error = absolute_error(
        Trajectory(truth.timestamps_s, truth.positions + noise, truth.quaternions_xyzw, True), truth, False
    )
    assert error.rms_m == pytest.approx(0.01 * np.sqrt(3), rel=0.15)


@pytest.mark.parametrize("positions", [np.zeros((5, 3)), np.outer(np.arange(5), [1, 0, 0])])
def test_a_path_that_fixes_no_alignment_is_refused(positions: np.ndarray) -> None:
    path = Trajectory(np.arange(5.0), positions.astype(float), np.tile([0.0, 0, 0, 1], (5, 1)), True)
    with pytest.raises(UserError):
        absolute_error(path, path, with_scale=True)


def test_paths_of_different_times_are_refused() -> None:
    path = make_path()
    with pytest.raises(UserError, match="same time"):
        absolute_error(Trajectory(path.timestamps_s + 1000.0, path.positions, path.quaternions_xyzw, True), path, False)


def test_files_of_both_formats_are_read(tmp_path: Path) -> None:
    path = make_path()
    tum, kitti = tmp_path / "tum.txt", tmp_path / "kitti.txt"
    np.savetxt(
        tum, np.column_stack([path.timestamps_s, path.positions, path.quaternions_xyzw]), header="timestamp tx ..."
    )
    matrices = np.concatenate(
        [Rotation.from_quat(path.quaternions_xyzw).as_matrix(), path.positions[..., None]], axis=2
    )
    np.savetxt(kitti, matrices.reshape(-1, 12))
    for file, has_times in ((tum, True), (kitti, False)):
        read = read_trajectory(file)
        assert read.has_times == has_times
        np.testing.assert_allclose(read.positions, path.positions)
        assert absolute_error(read, read_trajectory(file), with_scale=False).rms_m < 1e-9
    with pytest.raises(UserError, match="timestamps"):
        absolute_error(read_trajectory(tum), read_trajectory(kitti), with_scale=False)


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "no pose"),
        ("1 2 3\n", "8 numbers"),
        ("1 2 3 4 5 6 7 8\nx 2 3 4 5 6 7 8\n", ":2:"),
        ("nan 2 3 4 5 6 7 8\n", "finite"),
    ],
)
def test_a_file_that_makes_no_sense_is_refused(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "trajectory.txt"
    file.write_text(text)
    with pytest.raises(UserError, match=words):
        read_trajectory(file)
