"""tessera evaluate: the error of a run or a trajectory file against ground truth."""

import json
from argparse import Namespace
from pathlib import Path

import numpy as np

from tessera_cli.errors import UserError
from tessera_cli.trajectories import Trajectory, absolute_error, read_trajectory


def main(arguments: Namespace) -> int:
    estimate_path = Path(arguments.estimate)
    is_run = estimate_path.is_dir()
    truth = read_trajectory(_truth_path(arguments, is_run))
    if is_run:
        estimate = _read_run(estimate_path, truth)
    else:
        estimate = read_trajectory(estimate_path)
    alignment = arguments.align or _default_alignment(estimate_path, is_run)
    error = absolute_error(estimate, truth, with_scale=alignment == "sim3")
    errors = error.errors_m
    print(f"poses      {len(errors)} of {len(estimate.positions)} have a ground truth")
    print(f"alignment  {error.alignment}, scale {error.scale:.6f}")
    print(f"RMS error  {error.rms_m:.4f} m")
    print(f"           mean {errors.mean():.4f} m, median {np.median(errors):.4f} m, 95 % {np.percentile(errors, 95):.4f} m, "
          f"max {errors.max():.4f} m")
    return 0


def _truth_path(arguments: Namespace, is_run: bool) -> Path:
    if arguments.truth:
        return Path(arguments.truth)
    own = Path(arguments.estimate) / "ground_truth.txt"
    if not is_run or not own.is_file():
        raise UserError(f"{arguments.estimate} brings no ground truth: give GROUND_TRUTH as the second argument.")
    return own


def _read_run(folder: Path, truth: Trajectory) -> Trajectory:
    """The run's file that goes with the truth: by time or by frame."""
    name = "trajectory.txt" if truth.has_times else "trajectory_kitti.txt"
    if not (folder / name).is_file():
        raise UserError(f"{folder} is no run's folder: it holds no {name}.")
    return read_trajectory(folder / name)


def _default_alignment(estimate_path: Path, is_run: bool) -> str:
    """Mono doesn't know its scale; stereo and RGB-D must."""
    if is_run and (estimate_path / "summary.json").is_file():
        return "sim3" if json.loads((estimate_path / "summary.json").read_text())["sensor"] == "mono" else "se3"
    return "sim3"
