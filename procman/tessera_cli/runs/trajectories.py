"""Trajectory files, and the error of one against another by the evo package.

Positions are meters (mono: map units), rotations unit quaternions x y z w, both of the camera in the world.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tessera_cli.errors import UserError

# Poses of the two files belong together if their times differ by at most this.
MAX_TIME_DIFFERENCE_S = 0.02
# Fewer poses than this don't determine an alignment.
MIN_POSES = 3


@dataclass(frozen=True)
class Trajectory:
    """Poses of the camera in the world, in order of time."""

    timestamps_s: np.ndarray  # n; of a KITTI file: the row's number
    positions: np.ndarray  # n x 3
    quaternions_xyzw: np.ndarray  # n x 4
    has_times: bool


@dataclass(frozen=True)
class TrajectoryError:
    """Absolute trajectory error after the best alignment of the estimate to the truth."""

    timestamps_s: np.ndarray  # n, of the poses that have a truth
    estimate: np.ndarray  # n x 3, aligned, meters
    truth: np.ndarray  # n x 3, meters
    errors_m: np.ndarray  # n
    scale: float  # that the estimate was multiplied by
    alignment: str
    rotation: np.ndarray  # 3 x 3, truth_from_estimate
    translation: np.ndarray  # 3, meters
    num_estimated: int  # poses of the estimate, with or without a truth

    @property
    def rms_m(self) -> float:
        return float(np.sqrt(np.mean(self.errors_m**2)))

    def align(self, positions: np.ndarray) -> np.ndarray:
        """N x 3 of the estimate's world in the truth's: scale * rotation * p + translation."""
        return self.scale * positions @ self.rotation.T + self.translation


def read_trajectory(path: Path) -> Trajectory:
    """Reads TUM rows (8 numbers) or KITTI rows (12 numbers)."""
    rows = _read_rows(path)
    columns = {len(row) for row in rows}
    if columns == {8}:
        table = np.array(rows)
        return Trajectory(table[:, 0], table[:, 1:4], table[:, 4:8], has_times=True)
    if columns == {12}:
        return _from_kitti(np.array(rows).reshape(-1, 3, 4))
    raise UserError(f"{path}: every row must hold 8 numbers (TUM) or 12 (KITTI), but rows hold {sorted(columns)}.")


def _read_rows(path: Path) -> list[list[float]]:
    try:
        lines = path.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: can't be read as text ({error.__class__.__name__}).") from error
    rows = []
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            rows.append([float(word) for word in line.replace(",", " ").split()])
        except ValueError as error:
            raise UserError(f"{path}:{number}: not a row of numbers.") from error
        if not np.all(np.isfinite(rows[-1])):
            raise UserError(f"{path}:{number}: holds a number that is not finite.")
    if not rows:
        raise UserError(f"{path}: holds no pose.")
    return rows


def _from_kitti(matrices: np.ndarray) -> Trajectory:
    from scipy.spatial.transform import Rotation

    quaternions = Rotation.from_matrix(matrices[:, :, :3]).as_quat()
    return Trajectory(np.arange(len(matrices), dtype=float), matrices[:, :, 3], quaternions, has_times=False)


def absolute_error(estimate: Trajectory, truth: Trajectory, with_scale: bool) -> TrajectoryError:
    """Associates by timestamp (KITTI files: by row), aligns with Sim(3) or SE(3), and measures the distances.

    Raises UserError where the two don't belong together or don't determine an alignment.
    """
    from evo.core import metrics, sync
    from evo.core.geometry import GeometryException

    if estimate.has_times != truth.has_times:
        raise UserError("one trajectory has timestamps and the other has none: give two TUM files or two KITTI files.")
    if not estimate.has_times and len(estimate.positions) != len(truth.positions):
        rows = f"one has {len(estimate.positions)} rows and the other {len(truth.positions)}"
        raise UserError(f"KITTI files go together by row, but {rows}.")
    try:
        true_path, estimated_path = sync.associate_trajectories(
            _to_evo(truth), _to_evo(estimate), max_diff=MAX_TIME_DIFFERENCE_S
        )
    except sync.SyncException as error:
        raise UserError("no two poses of the trajectories have the same time.") from error
    if true_path.num_poses < MIN_POSES:
        raise UserError(f"only {true_path.num_poses} poses have a ground truth; an alignment needs {MIN_POSES}.")
    try:
        rotation, translation, scale = estimated_path.align(true_path, correct_scale=with_scale)
    except GeometryException as error:
        raise UserError("the poses don't determine an alignment: the camera stood still or moved on a line.") from error
    position_error = metrics.APE(metrics.PoseRelation.translation_part)
    position_error.process_data((true_path, estimated_path))
    return TrajectoryError(
        timestamps_s=np.asarray(true_path.timestamps),
        estimate=estimated_path.positions_xyz,
        truth=true_path.positions_xyz,
        errors_m=np.asarray(position_error.error),
        scale=float(scale),
        alignment="Sim(3)" if with_scale else "SE(3)",
        rotation=rotation,
        translation=translation,
        num_estimated=len(estimate.positions),
    )


def truth_in_estimate(truth: Trajectory, error: TrajectoryError) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n x 3) and quaternions x y z w (n x 4) of the truth in the estimate's world."""
    from scipy.spatial.transform import Rotation

    positions = (truth.positions - error.translation) @ error.rotation / error.scale
    turned = Rotation.from_matrix(error.rotation.T) * Rotation.from_quat(truth.quaternions_xyzw)
    return positions, turned.as_quat()


def length_m(positions: np.ndarray) -> float:
    """Of the path through n x 3 positions."""
    return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())


def _to_evo(trajectory: Trajectory) -> Any:
    from evo.core.trajectory import PoseTrajectory3D

    return PoseTrajectory3D(
        positions_xyz=trajectory.positions.copy(),
        timestamps=trajectory.timestamps_s,
        orientations_quat_wxyz=np.roll(trajectory.quaternions_xyzw, 1, axis=1),
    )
