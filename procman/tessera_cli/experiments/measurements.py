"""The figures of one run that experiments compare, and what limits its speed."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tessera_cli.runs.run_folder import Summary

EXTRACTORS = "extractors"
# From this share of all cores on, the machine itself is the limit: steps get longer because they wait for a core.
FULL_SHARE = 0.95


@dataclass(frozen=True)
class Measurement:
    """Of one run. What the run did not measure is None or empty."""

    frames: int
    frames_per_s: float
    cpu_ms: dict[str, float]  # per frame, by kind of process: all extractors are one
    busy_ms: dict[str, float]  # per frame, by process: wall time of its steps
    keyframes: int
    error_m: float | None  # RMS
    latency_median_ms: float | None
    latency_p95_ms: float | None
    map_wait_ms: float | None  # mean per frame, of the tracker
    hashes: tuple[str, str]  # of the trajectory and of the map

    @property
    def all_cpu_ms(self) -> float:
        return sum(self.cpu_ms.values())

    @property
    def period_ms(self) -> float:
        """From one frame to the next."""
        return 1000.0 / self.frames_per_s


def measure(summary: Summary) -> Measurement:
    """`summary`: of a run that came to its end, also one of an older commit."""
    frames = summary["frames"]
    latency, wait = summary.get("latency_ms") or {}, summary.get("map_wait_ms") or {}
    steps = summary.get("stage_ms") or {}
    return Measurement(
        frames=frames,
        frames_per_s=summary["frames_per_s"],
        cpu_ms=_by_kind(cpu_ms_of(summary)),
        busy_ms={name: step["count"] * step["mean"] / frames for name, step in steps.items() if "count" in step},
        keyframes=summary["keyframes"],
        error_m=summary.get("rms_error_m"),
        latency_median_ms=latency.get("median"),
        latency_p95_ms=latency.get("p95"),
        map_wait_ms=wait.get("mean"),
        hashes=(summary.get("trajectory_sha256") or "", summary.get("map_sha256") or ""),
    )


def cpu_ms_of(summary: Summary) -> dict[str, float]:
    """CPU time of a frame, by process."""
    return {name: 1000.0 * cpu_s / summary["frames"] for name, cpu_s in summary["cpu_s"].items()}


def _by_kind(by_process: dict[str, float]) -> dict[str, float]:
    """Extractors as one: their number is not the same everywhere."""
    kinds: dict[str, float] = {}
    for name, value in by_process.items():
        kind = EXTRACTORS if name.startswith("extractor_") else name
        kinds[kind] = kinds.get(kind, 0.0) + value
    return kinds


@dataclass(frozen=True)
class Spread:
    """Of one figure over repetitions."""

    median: float
    lowest: float
    highest: float


def spread(values: Iterable[float | None]) -> Spread | None:
    """None unless every run has a value."""
    all_values = list(values)
    known = [value for value in all_values if value is not None]
    if not known or len(known) < len(all_values):
        return None
    return Spread(float(np.median(known)), min(known), max(known))


def is_repeatable(runs: list[Measurement]) -> bool:
    """Whether all runs gave the same trajectory and map, bit for bit."""
    return len({run.hashes for run in runs}) <= 1


def find_limit(run: Measurement, cores: int) -> str:
    """Who is busy for which share of the time, the tightest first: the busiest process and the cores.

    A frame can't come faster than the longest step per frame of any process (the critical path of a pipeline), nor
    faster than all cores together can do the work of one frame. `cores`: that the run could use.
    """
    share = run.all_cpu_ms / (cores * run.period_ms)
    of_cores = f"{'cores' if cores > 1 else 'core'} {100 * share:.0f} %"
    if not run.busy_ms:
        return of_cores
    name, busy_ms = max(run.busy_ms.items(), key=lambda item: (item[1], item[0]))
    of_stage = f"{name} {100 * busy_ms / run.period_ms:.0f} %"
    return ", ".join([of_cores, of_stage] if share >= FULL_SHARE else [of_stage, of_cores])


def largest_part(parts: dict[str, float]) -> str:
    """In words, what makes up most of a sum."""
    name, value = max(parts.items(), key=lambda item: (item[1], item[0]))
    return f"{name} {100 * value / sum(parts.values()):.0f} %"
