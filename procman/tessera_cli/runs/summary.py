"""summary.json, trajectory.png and report.html of a run, from what the evaluator wrote and the kernel accounted."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

from tessera_cli.errors import RunFailed
from tessera_cli.files import write_text
from tessera_cli.report import trajectory_plot as plot
from tessera_cli.report.html_report import write_report
from tessera_cli.runs.run_folder import Result, default_alignment, read_run
from tessera_cli.supervision.private_deputy import PrivateDeputy
from tessera_cli.versions import collect_versions

# What the evaluator's run.json hands over as it is.
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


@dataclass(frozen=True)
class RunFacts:
    """What the launcher alone knows."""

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


def summarize(folder: Path, facts: RunFacts, deputy: PrivateDeputy) -> dict:
    """As write_summary, of a run of this machine."""
    return write_summary(
        folder,
        facts,
        ProcessFacts(
            cpu_s={process.name: process.cpu_s for process in deputy.processes},
            max_rss_mb={process.name: process.max_rss_mb for process in deputy.processes},
            num_extractor_restarts=deputy.num_restarts("extractor"),
            warnings=deputy.warnings,
        ),
    )


def write_summary(folder: Path, facts: RunFacts, processes: ProcessFacts) -> dict:
    """Writes summary.json, trajectory.png and report.html, and returns the summary. Raises RunFailed if the evaluator wrote nothing."""
    evaluated = _read_evaluation(folder)
    result = read_run(folder, alignment=default_alignment({"sensor": facts.sensor}))
    summary = {
        "source": facts.source,
        "sensor": facts.sensor,
        "extractors": facts.extractors,
        "tiles": facts.tiles,
        "ended": facts.ended,
    }
    summary.update({key: evaluated.get(key) for key in EVALUATOR_KEYS})
    summary.update(
        rms_error_m=result.error.rms_m if result.error else None,
        alignment=_in_words(result),
        wall_s=round(facts.wall_s, 3),
        frames_per_s=round(evaluated["frames"] / facts.wall_s, 3) if facts.wall_s > 0 else None,
        cpu_s={name: round(cpu_s, 3) for name, cpu_s in processes.cpu_s.items()},
        max_rss_mb={name: round(rss_mb, 1) for name, rss_mb in processes.max_rss_mb.items()},
        messages_undecodable=facts.messages_undecodable,
        extractor_restarts=processes.num_extractor_restarts,
        warnings=processes.warnings,
        versions=collect_versions(),
    )
    write_text(folder / "summary.json", json.dumps(summary, indent=2) + "\n")
    result = replace(result, summary=summary)
    _plot(folder, result)
    write_report([result], folder / "report.html")
    return summary


def _read_evaluation(folder: Path) -> dict:
    try:
        return json.loads((folder / "run.json").read_text())
    except (OSError, ValueError) as error:
        raise RunFailed(
            f"the evaluator left no results in {folder}; {folder / 'stages' / 'evaluator.log'} may say why."
        ) from error


def _in_words(result: Result) -> str:
    """The alignment, or why there is none."""
    error = result.error
    return (
        f"{error.alignment} over {len(error.errors_m)} frames, scale {error.scale:.6g}"
        if error
        else f"none: {result.error_note}"
    )


def _plot(folder: Path, result: Result) -> None:
    summary = result.summary
    kind, _, place = summary["source"].partition(":")
    title = (
        f"{kind}:{place.rstrip('/').rpartition('/')[2]}, {summary['sensor']}: "
        f"{summary['frames_tracked']} of {summary['frames']} frames tracked"
    )
    if result.error:
        plot.plot_error(result, title, folder / "trajectory.png")
    elif result.estimate:
        plot.plot_estimate(result, title, folder / "trajectory.png")


def _loops_in_words(summary: dict) -> str:
    """How many candidates for a loop each check let through."""
    counts = (summary.get("stage_values") or {}).get("loop_closer", {})
    if not counts.get("loop_candidates"):
        return ""
    alike, consistent, matched, aligned, confirmed = (
        int(counts.get(f"loop_{name}", 0)) for name in ("candidates", "consistent", "matched", "aligned", "confirmed")
    )
    return (
        f"loop candidates: {alike} places looked alike, {consistent} also from the keyframes before, {matched} shared enough landmarks, "
        f"{aligned} agreed on where the camera stood, {confirmed} were confirmed"
    )


def in_words(summary: dict, folder: Path) -> str:
    """The result for people, a few lines."""
    lines = [
        f"{summary['frames']} frames in {summary['wall_s']:.1f} s ({summary['frames_per_s'] or 0:.1f}/s): "
        f"{summary['frames_tracked']} tracked, {summary['frames_initializing']} before the start of the map, "
        f"{summary['frames_lost']} lost, {summary['frames_dropped']} dropped",
        f"map: {summary['keyframes']} keyframes, {summary['landmarks']} landmarks, {summary['loops_closed'] or 0} loops closed; "
        f"tracking failures: {summary['tracking_failures']}, relocalizations: {summary['relocalizations']}",
    ]
    if words := _loops_in_words(summary):
        lines.append(words)
    if summary["rms_error_m"] is not None:
        lines.append(f"RMS error {summary['rms_error_m']:.3f} m after alignment by {summary['alignment']}")
    else:
        lines.append(f"error: {summary['alignment']}")
    lines.append(
        f"{_statistics('pose time', summary['pose_time_ms'])}; {_statistics('latency', summary['latency_ms'])}"
    )
    if wait := summary["map_wait_ms"]:
        lines.append(
            f"the tracker waited for the mapper {wait['mean']:.1f} ms a frame, 95 % {wait['p95']:.1f} ms, longest {wait['max']:.0f} ms"
        )
    lines.append(
        f"messages: {summary['messages_repaired']} repaired, {summary['messages_lost']} lost, "
        f"{summary['messages_undecodable']} undecodable; extractors started again: {summary['extractor_restarts']}"
    )
    lines += [f"warning: {warning}" for warning in summary["warnings"]]
    lines.append(f"report: {folder / 'report.html'}")
    return "\n".join(lines)


def _statistics(name: str, milliseconds: dict | None) -> str:
    if not milliseconds:
        return f"{name}: not measured"
    return f"{name}: median {milliseconds['median']:.1f} ms, 95 % {milliseconds['p95']:.1f} ms"
