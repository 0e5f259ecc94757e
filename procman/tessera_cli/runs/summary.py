"""summary.json of a run, from what the evaluator wrote and what its processes used."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tessera_cli.errors import RunError
from tessera_cli.files import write_text
from tessera_cli.runs.run_folder import Frames, Result, Summary, default_alignment, read_run
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


def scale_warnings(frames: Frames | None, sensor: str) -> list[str]:
    """A sentence for each stretch of frames whose images contradict how the camera moved a moment before.

    Frames no more than MAX_GAP_FRAMES apart belong together.
    """
    if frames is None:
        return []
    stretches: list[list[int]] = []
    for number in frames.numbers[frames.is_step_doubtful]:
        if stretches and number - stretches[-1][-1] <= MAX_GAP_FRAMES:
            stretches[-1].append(int(number))
        else:
            stretches.append([int(number)])
    return [_doubt_of(stretch, sensor) for stretch in stretches]


def _doubt_of(stretch: list[int], sensor: str) -> str:
    where = f"at frame {stretch[0]}" if len(stretch) == 1 else f"between frames {stretch[0]} and {stretch[-1]}"
    times = "once" if len(stretch) == 1 else f"{len(stretch)} times"
    if sensor == "mono":
        what, consequence = "The scale may have slipped", "what follows may lie on another scale"
    else:
        what, consequence = "The estimated motion is doubtful", "poses there may be wrong"
    return f"{what} {where}: the images contradicted {times} how the camera moved a moment before; {consequence}."


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
