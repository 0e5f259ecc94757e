"""trajectory.png: the estimate over the truth, seen from above, and the error along the way."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tessera_cli.files import replacing
from tessera_cli.runs.run_folder import Result, positions_at

AXES = "xyz"


def widest_axes(positions: np.ndarray) -> tuple[int, int]:
    """The two axes along which the path extends most: the view from above, however the world is turned."""
    extent = np.ptp(positions, axis=0)
    first, second = sorted(np.argsort(-extent, kind="stable")[:2])
    return int(first), int(second)


def draw_path(axes, positions: np.ndarray, across: int, along: int, unit: str) -> None:
    axes.plot(positions[:1, across], positions[:1, along], "o", color="black", markersize=5, label="start")
    axes.set_xlabel(f"{AXES[across]} [{unit}]")
    axes.set_ylabel(f"{AXES[along]} [{unit}]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)
    axes.legend()


def save(figure: Figure, path: Path) -> None:
    with replacing(path) as written:
        figure.savefig(written, dpi=120)


def draw_loops(axes, result: Result, across: int, along: int) -> None:
    """A line from each keyframe that closed a loop to the one it was matched with."""
    label = f"{len(result.loops)} {'loop' if len(result.loops) == 1 else 'loops'} closed"
    for loop in result.loops:
        ends = result.in_truth(positions_at(result.estimate, [loop.keyframe_s, loop.matched_s]))
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


def plot_error(result: Result, title: str, path: Path) -> None:
    error = result.error
    figure = Figure(figsize=(13, 6), layout="constrained")
    from_above, along_way = figure.subplots(1, 2)
    across, along = widest_axes(error.truth)
    from_above.plot(error.truth[:, across], error.truth[:, along], color="0.7", linewidth=4, label="ground truth")
    from_above.plot(
        error.estimate[:, across],
        error.estimate[:, along],
        color="tab:blue",
        linewidth=1.2,
        label=f"estimate, {error.alignment} aligned",
    )
    draw_loops(from_above, result, across, along)
    draw_path(from_above, error.truth, across, along, "m")
    seconds = error.timestamps_s - error.timestamps_s[0]
    along_way.plot(seconds, error.errors_m, color="tab:red", linewidth=1)
    along_way.axhline(error.rms_m, color="black", linestyle="--", linewidth=1, label=f"RMS {error.rms_m:.3f} m")
    along_way.set_xlabel("time [s]")
    along_way.set_ylabel("position error [m]")
    along_way.set_ylim(bottom=0)
    along_way.grid(alpha=0.3)
    along_way.legend()
    figure.suptitle(title)
    save(figure, path)


def plot_estimate(result: Result, title: str, path: Path) -> None:
    """For a source without ground truth."""
    figure = Figure(figsize=(7, 6), layout="constrained")
    axes = figure.subplots()
    positions = result.estimate.positions
    across, along = widest_axes(positions)
    axes.plot(positions[:, across], positions[:, along], color="tab:blue", linewidth=1.2, label="estimate")
    draw_loops(axes, result, across, along)
    draw_path(axes, positions, across, along, result.unit)
    figure.suptitle(title)
    save(figure, path)
