"""summary.json of a run, from what the evaluator wrote and what its processes used."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tessera_cli.constants import MAX_SCALE_SIGMA
from tessera_cli.errors import RunError
from tessera_cli.files import write_text
from tessera_cli.runs.run_folder import Frames, Result, Summary, default_alignment, read_run
from tessera_cli.supervision.progress import FINISHED, StageReport
from tessera_cli.versions import collect_versions

# Frames with doubtful steps that are no farther apart belong to one stretch.
MAX_GAP_FRAMES = 30

# Copied unchanged from the evaluator's run.json.
EVALUATOR_KEYS = (
    "frames",
    "frames_tracked",
    "frames_lost",
    "frames_initializing",
    "frames_dropped",
    "tracking_failures",
    "relocalizations",
    "keyframes",
    "landmarks",
    "map_parts",
    "parts",
    "loops_closed",
    "stage_values",
    "pose_time_ms",
    "latency_ms",
    "map_wait_ms",
    "stage_ms",
    "messages_repaired",
    "messages_lost",
    "trajectory_sha256",
    "map_sha256",
)

# Makes pictures and a report of a result in its run's folder, and returns what to print about it.
Present = Callable[[Result, Path], str]


@dataclass(frozen=True)
class RunFacts:
    """What only the command that started the run knows."""

    source: str
    sensor: str
    extractors: int
    tiles: str
    wall_s: float  # from the camera's start to the last pose
    ended: str  # "complete", "interrupted", or the sentence of a failure
    messages_undecodable: int


@dataclass(frozen=True)
class ProcessFacts:
    """What the processes of a run used, and how they fared."""

    cpu_s: dict[str, float]
    max_rss_mb: dict[str, float]
    num_extractor_restarts: int
    warnings: list[str]


def write_summary(folder: Path, facts: RunFacts, processes: ProcessFacts) -> Result:
    """Writes summary.json and returns the run with it. Raises RunError if the evaluator wrote nothing."""
    evaluated = _read_evaluation(folder)
    result = read_run(folder, alignment=default_alignment({"sensor": facts.sensor}))
    summary: Summary = {
        "source": facts.source,
        "sensor": facts.sensor,
        "extractors": facts.extractors,
        "tiles": facts.tiles,
        "ended": facts.ended,
        **{key: evaluated.get(key) for key in EVALUATOR_KEYS},
        "occupancy_sha256": occupancy_sha256(folder),
        "rms_error_m": result.error.rms_m if result.error else None,
        "alignment": _describe_alignment(result),
        "wall_s": round(facts.wall_s, 3),
        "frames_per_s": round(evaluated["frames"] / facts.wall_s, 3) if facts.wall_s > 0 else None,
        "cpu_s": {name: round(cpu_s, 3) for name, cpu_s in processes.cpu_s.items()},
        "max_rss_mb": {name: round(rss_mb, 1) for name, rss_mb in processes.max_rss_mb.items()},
        "messages_undecodable": facts.messages_undecodable,
        "extractor_restarts": processes.num_extractor_restarts,
        "warnings": processes.warnings + scale_warnings(result.frames, facts.sensor),
        "versions": collect_versions(),
    }
    write_text(folder / "summary.json", json.dumps(summary, indent=2) + "\n")
    return replace(result, summary=summary)


def occupancy_sha256(folder: Path) -> str | None:
    """Of the occupancy map's file; None without one."""
    path = folder / "occupancy.bt"
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else None


def occupancy_warnings(report: StageReport | None) -> list[str]:
    """What the occupancy map lacks; `report`: the last one of its stage, if there was one."""
    if report is None:
        return []
    if report.state != FINISHED:
        return ["The occupancy map was not finished when the run ended: there are no occupancy files."]
    num_missing = int(report.values.get("keyframes_without_scan", 0))
    if num_missing == 0:
        return []
    return [f"The images of {num_missing} keyframes did not reach the occupancy stage: its map lacks what they saw."]


def scale_warnings(frames: Frames | None, sensor: str) -> list[str]:
    """A sentence for each stretch of frames after which the map may lie on another scale, in their order.

    The images contradict how the camera moved a moment before, or leave open how far it went.
    """
    if frames is None:
        return []
    contradicted = [(stretch[0], _contradiction(stretch, sensor)) for stretch in _stretches(frames, "contradicted")]
    open_scale = [(stretch[0], _open_scale(frames, stretch)) for stretch in _stretches(frames, "open")]
    return [sentence for _, sentence in sorted(contradicted + open_scale)]


def _stretches(frames: Frames, doubt: str) -> list[list[int]]:
    """The numbers of frames in doubt; those no more than MAX_GAP_FRAMES apart belong together."""
    in_doubt = frames.is_step_doubtful if doubt == "contradicted" else frames.scale_sigma > MAX_SCALE_SIGMA
    stretches: list[list[int]] = []
    for number in frames.numbers[in_doubt]:
        if stretches and number - stretches[-1][-1] <= MAX_GAP_FRAMES:
            stretches[-1].append(int(number))
        else:
            stretches.append([int(number)])
    return stretches


def _where(stretch: list[int]) -> str:
    return f"at frame {stretch[0]}" if len(stretch) == 1 else f"between frames {stretch[0]} and {stretch[-1]}"


def _contradiction(stretch: list[int], sensor: str) -> str:
    times = "once" if len(stretch) == 1 else f"{len(stretch)} times"
    if sensor == "mono":
        what, consequence = "The scale may have slipped", "what follows may lie on another scale"
    else:
        what, consequence = "The estimated motion is doubtful", "poses there may be wrong"
    reason = f"the images contradicted {times} how the camera moved a moment before"
    return f"{what} {_where(stretch)}: {reason}; {consequence}."


def _open_scale(frames: Frames, stretch: list[int]) -> str:
    sigma = float(np.max(frames.scale_sigma[np.isin(frames.numbers, stretch)]))
    return (
        f"The scale may have slipped {_where(stretch)} by a factor of {np.exp(sigma):.1f} (one standard deviation): "
        "the images left open how far the camera went; what follows may lie on another scale."
    )


def _read_evaluation(folder: Path) -> dict[str, Any]:
    try:
        return json.loads((folder / "run.json").read_text())
    except (OSError, ValueError) as error:
        log = folder / "stages" / "evaluator.log"
        raise RunError(f"the evaluator left no results in {folder}; {log} may say why.") from error


def _describe_alignment(result: Result) -> str:
    """The alignment, or why there is none."""
    error = result.error
    if error is None:
        return f"none: {result.error_note}"
    return f"{error.alignment} over {len(error.errors_m)} frames, scale {error.scale:.6g}"
