"""summary.json of a run, from what the evaluator wrote and what its processes used."""

import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tessera_cli.constants import MAX_SCALE_SIGMA
from tessera_cli.errors import RunError
from tessera_cli.files import write_text
from tessera_cli.runs.run_folder import Frames, Result, Summary, default_alignment, read_run, read_source_events
from tessera_cli.settings import without_password
from tessera_cli.supervision.progress import FINISHED, StageReport
from tessera_cli.text import focal_words, visible_values
from tessera_cli.versions import collect_versions

# Frames with doubtful steps that are no farther apart belong to one stretch.
MAX_GAP_FRAMES = 30
MAX_SCALE_WARNINGS = 5  # sentences; a camera that is thrown about may give one every few seconds
# A live pose that comes later was queued: one frame is extracted, one tracked, and one waits (latency_watch.h).
MAX_LATENCY_INTERVALS = 3
# Of the points that a frame matched, in the median of the frames. 240 runs of real and simulated sequences had 0.79 to
# 0.97; a lens whose distortion was left out of its calibration 0.71 to 0.73.
MIN_AGREEING_SHARE = 0.77
MIN_AGREEING_FRAMES = 30  # fewer say nothing of a run

# Copied unchanged from the evaluator's run.json.
EVALUATOR_KEYS = (
    "frames",
    "frames_tracked",
    "frames_lost",
    "frames_initializing",
    "frames_dropped",
    "frames_missing",
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
    messages_of_strangers: int  # that were passed over; each process counts what it hears
    not_written: tuple[str, ...] = ()  # sentences about files that only the command knows of


@dataclass(frozen=True)
class ProcessFacts:
    """What the processes of a run used, and how they fared."""

    cpu_s: dict[str, float]
    max_rss_mb: dict[str, float]
    num_extractor_restarts: int
    warnings: list[str]
    # By stage: what those told that worked on when the evaluator had ended.
    later_values: dict[str, dict[str, float]] = field(default_factory=dict)


def write_summary(folder: Path, facts: RunFacts, processes: ProcessFacts) -> Result:
    """Writes summary.json and returns the run with it. Raises RunError if the evaluator wrote nothing.

    A summary that can't be written is returned all the same, with a sentence in `not_written`, as for all other files.
    """
    evaluated = _read_evaluation(folder)
    not_written = [*evaluated.get("not_written", []), *facts.not_written]
    result = read_run(folder, alignment=default_alignment({"sensor": facts.sensor}))
    summary: Summary = {
        "source": without_password(facts.source),
        "sensor": facts.sensor,
        "extractors": facts.extractors,
        "tiles": facts.tiles,
        "ended": judge_end(facts.ended, evaluated),
        **{key: evaluated.get(key) for key in EVALUATOR_KEYS},
        "stage_values": {**evaluated.get("stage_values", {}), **processes.later_values},
        "occupancy_sha256": occupancy_sha256(folder),
        "rms_error_m": result.error.rms_m if result.error else None,
        "alignment": _describe_alignment(result),
        "wall_s": round(facts.wall_s, 3),
        "frames_per_s": round(evaluated["frames"] / facts.wall_s, 3) if facts.wall_s > 0 else None,
        "cpu_s": {name: round(cpu_s, 3) for name, cpu_s in processes.cpu_s.items()},
        "max_rss_mb": {name: round(rss_mb, 1) for name, rss_mb in processes.max_rss_mb.items()},
        "messages_undecodable": facts.messages_undecodable,
        "messages_of_strangers": facts.messages_of_strangers,
        "extractor_restarts": processes.num_extractor_restarts,
        "warnings": processes.warnings
        + read_source_events(folder / "stages")
        + drop_warnings(evaluated, result)
        + latency_warnings(result)
        + scale_warnings(result.frames, facts.sensor)
        + mending_warnings(evaluated)
        + agreement_warnings(result.frames, facts.sensor)
        + focal_warnings(evaluated)
        + right_image_warnings(evaluated),
        "doubts": scale_doubts(result.frames),
        "not_written": not_written,
        "versions": collect_versions(),
    }
    with noting_if_not_written(summary, "summary.json"):
        write_text(folder / "summary.json", json.dumps(summary, indent=2) + "\n")
    return replace(result, summary=summary)


def why_nothing_was_located(summary: Summary, in_a_map: bool) -> str:
    """Of a run without a single pose: what its user should look at. `in_a_map`: it looked for places of a map only."""
    said = f"no pose was found for any of {summary['frames']} frames"
    if in_a_map:
        return f"{said}: is the map of this place, and of this camera?"
    if summary.get("sensor") == "stereo":
        return (
            f"{said}: hardly a point of the left images was found in the right ones; are the two of the same moment, "
            "not exchanged, sharp, and is their calibration right?"
        )
    if summary.get("sensor") == "rgbd":
        return f"{said}: do the depth images hold depths, in the calibration's unit, and are the others sharp?"
    return f"{said}: is the camera moving, are its images sharp, and is its calibration right?"


def is_trustworthy(summary: Summary) -> bool:
    """Nothing of the run is missing, and its scale is not in doubt."""
    return not summary["not_written"] and not summary["doubts"]


def judge_end(ended: str, evaluated: dict[str, Any]) -> str:
    """A run is complete if every frame that the camera sent has a pose, or is known to be lost or dropped."""
    missing = evaluated.get("frames_missing") or 0
    if ended != "complete" or missing == 0:
        return ended
    were = "frame is" if missing == 1 else "frames are"
    return f"incomplete: {missing} {were} not accounted for, of {evaluated['frames'] + missing} that the camera sent"


def drop_warnings(evaluated: dict[str, Any], result: Result) -> list[str]:
    """How many frames did not reach the tracker, and why; empty if all did."""
    dropped, frames = evaluated["frames_dropped"], evaluated["frames"]
    if not dropped:
        return []
    said = f"Dropped {dropped:,} of {frames:,} frames"
    camera = result.settings.get("camera", {})
    if camera.get("source", "").startswith("log:") and camera.get("pace") == "lockstep":
        return [f"{said}: so did the run that the log recorded."]
    seconds = _seconds_of_poses(result.frames)
    if not seconds:
        return [f"{said}: they came faster than the machine handles them."]
    handled = (frames - dropped) / seconds
    return [f"{said}: the machine handles {handled:.1f} frames a second of {frames / seconds:.1f}."]


def latency_warnings(result: Result) -> list[str]:
    """Of a live run whose poses came so late that frames must have waited."""
    seconds = _seconds_of_poses(result.frames)
    if result.frames is None or not seconds or not result.settings.get("dispatcher", {}).get("newest_wins"):
        return []
    numbers, latency_ms = result.frames.numbers, result.frames.latency_ms
    limit_ms = MAX_LATENCY_INTERVALS * 1000 * seconds / max(1, int(numbers[-1] - numbers[0]))
    late = latency_ms[latency_ms > limit_ms]
    if len(late) == 0:
        return []
    return [
        f"{len(late):,} of {len(latency_ms):,} poses came later than {MAX_LATENCY_INTERVALS} frame intervals "
        f"({limit_ms:.0f} ms) after the frame was taken, the latest after {late.max():,.0f} ms."
    ]


def _seconds_of_poses(frames: Frames | None) -> float:
    """From the first pose to the last, wall time; 0 if that is unknown."""
    return float(np.nansum(frames.pose_time_ms)) / 1000 if frames is not None else 0.0


@contextmanager
def noting_if_not_written(summary: Summary, name: str) -> Iterator[None]:
    """Within it, the file of this name is written; if the system refuses that, `not_written` gets a sentence."""
    try:
        yield
    except OSError as error:
        summary["not_written"].append(f"{name} can't be written: {error.strerror or error}")


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


def recording_warnings(report: StageReport | None) -> list[str]:
    """What the recording lacks; `report`: the last one of the recorder, if there was one."""
    if report is None or report.lost == 0:
        return []
    return [
        f"The recording lacks {report.lost} messages, which came faster than they could be written: it can't repeat "
        "the run exactly. procman/tessera log gaps run.lcmlog tells where; a slower --pace or a faster disk helps."
    ]


def scale_warnings(frames: Frames | None, sensor: str) -> list[str]:
    """A sentence for each stretch of frames after which the map may lie on another scale, in their order.

    The images contradict how the camera moved a moment before, or leave open how far it went.
    """
    if frames is None:
        return []
    contradicted = [(stretch, _contradiction(stretch, sensor)) for stretch in _stretches(frames, "contradicted")]
    open_scale = [(stretch, _open_scale(frames, stretch)) for stretch in _stretches(frames, "open")]
    doubts = sorted(contradicted + open_scale)
    sentences = [sentence for _, sentence in doubts]
    more = len(doubts) - MAX_SCALE_WARNINGS
    if more <= 0:
        return sentences
    were = "There was one more such doubt" if more == 1 else f"There were {more} more such doubts, the last"
    last = f"{were} {_where(doubts[-1][0])}: is_step_doubtful and scale_sigma in frames.csv."
    return [*sentences[:MAX_SCALE_WARNINGS], last]


def mending_warnings(evaluated: dict[str, Any]) -> list[str]:
    """Whether the scale of a mono map slipped and was mended by what the ground shows."""
    times = int(evaluated.get("stage_values", {}).get("mapper", {}).get("scale_mendings", 0))
    if times == 0:
        return []
    return [
        f"The scale slipped, or was a guess after a loss, and was mended {_times(times)} by what the ground below the "
        "camera shows: keyframes and trajectory.txt have that scale now, which may be off by some tenths; poses that "
        "were told live before keep theirs."
    ]


def agreement_warnings(frames: Frames | None, sensor: str) -> list[str]:
    """Of a run whose images and poses do not fit well: the camera may not be what its calibration says."""
    if frames is None:
        return []
    tracked = frames.matches > 0  # false of NaN, too
    if np.count_nonzero(tracked) < MIN_AGREEING_FRAMES:
        return []
    share = float(np.median(frames.inliers[tracked] / frames.matches[tracked]))
    if share >= MIN_AGREEING_SHARE:
        return []
    causes = {"stereo": "the two images of a pair are not of the same moment", "rgbd": "depths are wrong"}
    cause = f"{causes[sensor]}, " if sensor in causes else ""
    return [
        f"In half of the frames, at most {100 * share:.0f} % of the points that were found agree with the pose; as a "
        f"rule, it is 80 to 95 %. Poses may be wrong: the calibration does not fit (lens distortion), {cause}or much "
        "of what the camera sees moves."
    ]


def focal_warnings(evaluated: dict[str, Any]) -> list[str]:
    """Where the images fit other focal lengths, so much that no calibration can be as wrong."""
    doubt = evaluated.get("stage_values", {}).get("mapper", {}).get("focal_doubt")
    if not doubt:
        return []
    return [
        f"The images of this mono camera fit focal lengths {focal_words(doubt)} than the calibration's, which were not "
        "used: check the calibration, its lens distortion too. In turns the scale may change."
    ]


def right_image_warnings(evaluated: dict[str, Any]) -> list[str]:
    """Where the cameras of a stereo pair don't stand to each other as the calibration says."""
    values = evaluated.get("stage_values", {}).get("mapper", {})
    if doubt_px := values.get("right_shift_doubt_px"):
        return [
            f"Columns of the right image seem to stand {doubt_px:.1f} px beside where the calibration has them, which "
            "is too much to be corrected: calibrate the stereo pair anew."
        ]
    names = ("", "_across", "_down", "_bend")
    center, across, down, bend = (values.get(f"right_shift{name}_px", 0.0) for name in names)
    if not (center or across or down or bend):
        return []
    return [
        "The two cameras don't stand to each other as the calibration says. Columns of the right image were moved by "
        f"{center:+.2f} {across:+.2f} x {down:+.2f} y {bend:+.2f} x^2 px, with x, y from the image's center in halves "
        "of its width, as soon as that was found; depths before are less exact. Calibrate the stereo pair anew."
    ]


def scale_doubts(frames: Frames | None) -> list[str]:
    """Those among these warnings by which the run is not to be trusted: the images leave open how far the camera went.

    A contradiction is none: a camera that was carried elsewhere contradicts its motion, too, and is found again.
    """
    return [_open_scale(frames, stretch) for stretch in _stretches(frames, "open")] if frames is not None else []


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


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"


def _contradiction(stretch: list[int], sensor: str) -> str:
    times = _times(len(stretch))
    if sensor == "mono":
        what, consequence = "The scale may have slipped", "what follows may lie on another scale"
    else:
        what, consequence = "The estimated motion is doubtful", "poses there may be wrong"
    reason = f"the images contradicted {times} how the camera moved a moment before"
    return f"{what} {_where(stretch)}: {reason}; {consequence}."


def _open_scale(frames: Frames, stretch: list[int]) -> str:
    sigma = float(np.max(frames.scale_sigma[np.isin(frames.numbers, stretch)]))
    return (
        f"The scale may have slipped {_where(stretch)} by a factor of {np.exp(sigma):.1f} or so: "
        "the images left open how far the camera went, or the ground below it says otherwise; "
        "what follows may lie on another scale."
    )


def _read_evaluation(folder: Path) -> dict[str, Any]:
    try:
        return visible_values(json.loads((folder / "run.json").read_text()))
    except (OSError, ValueError) as error:
        log = folder / "stages" / "evaluator.log"
        raise RunError(f"the evaluator left no results in {folder}; {log} may say why.") from error


def _describe_alignment(result: Result) -> str:
    """The alignment, or why there is none."""
    error = result.error
    if error is None:
        return f"none: {result.error_note}"
    return f"{error.alignment} over {len(error.errors_m)} frames, scale {error.scale:.6g}"
