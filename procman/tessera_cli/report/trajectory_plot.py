"""trajectory.png: the estimated path over the true one, seen from above, and the error along it."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tessera_cli.files import replacing
from tessera_cli.report.grid_underlay import draw_grid
from tessera_cli.runs.run_folder import Result
from tessera_cli.runs.trajectories import TrajectoryError

AXES = "xyz"


def widest_axes(positions: np.ndarray) -> tuple[int, int]:
    """The two axes along which the path extends most: the view from above, however the world is oriented."""
    extent = np.ptp(positions, axis=0)
    first, second = sorted(np.argsort(-extent, kind="stable")[:2])
    return int(first), int(second)


def save_png(figure: Figure, path: Path) -> None:
    with replacing(path) as written:
        figure.savefig(written, dpi=120)


def plot_trajectory(result: Result, title: str, path: Path) -> None:
    """With the error along the path where there is a truth. Writes nothing without an estimate."""
    if result.error:
        _plot_error(result, result.error, title, path)
    elif result.estimate:
        _plot_estimate(result, title, path)


def _plot_error(result: Result, error: TrajectoryError, title: str, path: Path) -> None:
    figure = Figure(figsize=(13, 6), layout="constrained")
    from_above, along_path = figure.subplots(1, 2)
    across, along = widest_axes(error.truth)
    from_above.plot(error.truth[:, across], error.truth[:, along], color="0.7", linewidth=4, label="ground truth")
    label = f"estimate, {error.alignment} aligned"
    from_above.plot(error.estimate[:, across], error.estimate[:, along], color="tab:blue", linewidth=1.2, label=label)
    _draw_loops(from_above, result, across, along)
    _finish_path(from_above, error.truth, across, along, "m")
    draw_grid(from_above, result, across, along)
    seconds = error.timestamps_s - error.timestamps_s[0]
    along_path.plot(seconds, error.errors_m, color="tab:red", linewidth=1)
    along_path.axhline(error.rms_m, color="black", linestyle="--", linewidth=1, label=f"RMS {error.rms_m:.3f} m")
    along_path.set_xlabel("time [s]")
    along_path.set_ylabel("position error [m]")
    along_path.set_ylim(bottom=0)
    along_path.grid(alpha=0.3)
    along_path.legend()
    figure.suptitle(title)
    save_png(figure, path)


def _plot_estimate(result: Result, title: str, path: Path) -> None:
    figure = Figure(figsize=(7, 6), layout="constrained")
    axes = figure.subplots()
    positions = result.path()
    across, along = widest_axes(positions)
    axes.plot(positions[:, across], positions[:, along], color="tab:blue", linewidth=1.2, label="estimate")
    _draw_loops(axes, result, across, along)
    _finish_path(axes, positions, across, along, result.unit)
    draw_grid(axes, result, across, along)
    figure.suptitle(title)
    save_png(figure, path)


def _finish_path(axes: Axes, positions: np.ndarray, across: int, along: int, unit: str) -> None:
    """Its start, and axes to scale."""
    axes.plot(positions[:1, across], positions[:1, along], "o", color="black", markersize=5, label="start")
    axes.set_xlabel(f"{AXES[across]} [{unit}]")
    axes.set_ylabel(f"{AXES[along]} [{unit}]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)
    axes.legend()


def _draw_loops(axes: Axes, result: Result, across: int, along: int) -> None:
    """A line from each keyframe that closed a loop to the one it was matched with."""
    label: str | None = f"{len(result.loops)} {'loop' if len(result.loops) == 1 else 'loops'} closed"
    for ends in result.loop_lines():
        axes.plot(
            ends[:, across],
            ends[:, along],
            color="tab:red",
            marker="o",
            markersize=6,
            markerfacecolor="none",
            linewidth=1.2,
            label=label,
        )
        label = None
