"""The figures of one run of a distribution experiment, and of all runs of one configuration."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tessera_cli.experiments.distribution.grid import Configuration
from tessera_cli.experiments.distribution.lan import Traffic
from tessera_cli.experiments.distribution.runs import read_traffic
from tessera_cli.experiments.measurements import EXTRACTORS, Measurement, Spread, measure, spread
from tessera_cli.experiments.plan import read_complete
from tessera_cli.runs.run_folder import read_frames

# While the pipeline fills and mono finds its first map, poses come at another rate.
LEFT_OUT_SHARE = 0.1


@dataclass(frozen=True)
class Figures:
    """Of one run. What is unknown is NaN."""

    measurement: Measurement
    failures: int  # changes from tracked to lost
    poses_per_s: float  # once the pipeline is full
    pose_times_ms: np.ndarray  # between one pose and the next, likewise
    latencies_ms: np.ndarray  # of every frame, from the camera to its pose
    traffic: dict[int, Traffic]  # by host
    repaired: int
    lost: int

    @property
    def host_cpu_ms(self) -> float:
        """Per frame, of all processes but extractors: the estimating host, where extractors are elsewhere."""
        return self.measurement.all_cpu_ms - self.measurement.cpu_ms.get(EXTRACTORS, 0.0)

    @property
    def cores(self) -> float:
        """That the whole stack uses."""
        return self.measurement.all_cpu_ms / self.measurement.period_ms

    @property
    def wire_kb(self) -> float:
        """Per frame, both directions of the estimating host's link; on one host what its processes send each other."""
        if 1 not in self.traffic:
            return float("nan")
        is_alone = len(self.traffic) == 1
        total = self.traffic[1].sent + (0 if is_alone else self.traffic[1].received)
        return total / 1000 / self.measurement.frames


def read_figures(folder: Path) -> Figures | None:
    """None: the run has not ended well."""
    summary, frames = read_complete(folder), read_frames(folder / "frames.csv")
    if summary is None or frames is None:
        return None
    pose_times = frames.pose_time_ms[int(np.ceil(LEFT_OUT_SHARE * len(frames.pose_time_ms))) :]
    pose_times = pose_times[np.isfinite(pose_times)]
    return Figures(
        measurement=measure(summary),
        failures=summary["tracking_failures"],
        poses_per_s=float(1000 / np.mean(pose_times)) if len(pose_times) else float("nan"),
        pose_times_ms=pose_times,
        latencies_ms=frames.latency_ms[np.isfinite(frames.latency_ms)],
        traffic=read_traffic(folder),
        repaired=summary.get("messages_repaired") or 0,
        lost=summary.get("messages_lost") or 0,
    )


@dataclass(frozen=True)
class Cell:
    """All runs of one configuration."""

    configuration: Configuration
    runs: list[Figures]

    def spread(self, read: Callable[[Figures], float | None]) -> Spread | None:
        return spread(read(run) for run in self.runs)

    def median(self, read: Callable[[Figures], float | None]) -> float:
        """NaN where a run has no value."""
        found = self.spread(read)
        return found.median if found else float("nan")

    @property
    def hashes(self) -> set[tuple[str, str]]:
        return {run.measurement.hashes for run in self.runs}

    @property
    def typical(self) -> Figures:
        """The run of median speed."""
        return sorted(self.runs, key=lambda run: run.poses_per_s)[len(self.runs) // 2]
