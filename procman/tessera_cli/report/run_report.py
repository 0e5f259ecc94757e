"""What a finished run leaves for people: trajectory.png, report.html and a few lines on the terminal."""

import shutil
import sys
from pathlib import Path
from typing import Any

from tessera_cli.report.html_report import write_report
from tessera_cli.report.sentences import headline, parts_sentences, remarks, strangers_sentence
from tessera_cli.report.terminal_plot import draw_from_above
from tessera_cli.report.trajectory_plot import plot_trajectory
from tessera_cli.runs.run_folder import Result, Summary
from tessera_cli.runs.summary import noting_if_not_written

PICTURE_COLUMNS, PICTURE_LINES = 64, 24


def present_run(result: Result, folder: Path) -> str:
    """Writes picture and report into the run's folder. Returns the result in a few lines."""
    _write_pictures(result, folder)
    report = [f"report: {folder / 'report.html'}"] if (folder / "report.html").is_file() else []
    return "\n".join([*_lines(result.summary), *report])


def present_demo(result: Result, folder: Path) -> str:
    """As present_run, for people who see it for the first time."""
    _write_pictures(result, folder)
    sentences = headline(result) + (remarks(result) if result.summary["ended"] != "complete" else [])
    files = [f"picture: {folder / 'trajectory.png'}", f"report:  {folder / 'report.html'}  (open it in a browser)"]
    warnings = [f"warning: {sentence}" for sentence in result.summary["not_written"]]
    return "\n".join(["", *_picture(result), *sentences, *warnings, "", *files])


def _write_pictures(result: Result, folder: Path) -> None:
    summary = result.summary
    kind, _, place = summary["source"].partition(":")
    tracked = f"{summary['frames_tracked']} of {summary['frames']} frames tracked"
    title = f"{kind}:{place.rstrip('/').rpartition('/')[2]}, {summary['sensor']}: {tracked}"
    with noting_if_not_written(summary, "trajectory.png"):
        plot_trajectory(result, title, folder / "trajectory.png")
    with noting_if_not_written(summary, "report.html"):
        write_report([result], folder / "report.html")


def _picture(result: Result) -> list[str]:
    """For a terminal; nothing for logs and pipes."""
    if result.estimate is None or not sys.stdout.isatty():
        return []
    columns, lines = shutil.get_terminal_size()
    size = (min(columns - 2, PICTURE_COLUMNS), min(lines // 2, PICTURE_LINES))
    return [
        "The path from above, blue over the true one in gray:",
        "",
        draw_from_above(result, *size, colored=True),
        "",
    ]


def _lines(summary: Summary) -> list[str]:
    lines = [
        f"{summary['frames']} frames in {summary['wall_s']:.1f} s ({summary['frames_per_s'] or 0:.1f}/s): "
        f"{summary['frames_tracked']} tracked, {summary['frames_initializing']} before the start of the map, "
        f"{summary['frames_lost']} lost, {summary['frames_dropped']} dropped",
        f"map: {summary['keyframes']} keyframes, {summary['landmarks']} landmarks, "
        f"{summary['loops_closed'] or 0} loops closed; tracking failures: {summary['tracking_failures']}, "
        f"relocalizations: {summary['relocalizations']}",
    ]
    if loops := _describe_loop_checks(summary):
        lines.append(loops)
    if summary["rms_error_m"] is not None:
        lines.append(f"RMS error {summary['rms_error_m']:.3f} m after alignment by {summary['alignment']}")
    else:
        lines.append(f"error: {summary['alignment']}")
    pose_time = _describe_times("pose time", summary["pose_time_ms"])
    lines.append(f"{pose_time}; {_describe_times('latency', summary['latency_ms'])}")
    if wait := summary["map_wait_ms"]:
        times = f"{wait['mean']:.1f} ms a frame, 95 % {wait['p95']:.1f} ms, longest {wait['max']:.0f} ms"
        lines.append(f"the tracker waited for the mapper {times}")
    lines.append(
        f"messages: {summary['messages_repaired']} repaired, {summary['messages_lost']} lost, "
        f"{summary['messages_undecodable']} undecodable; extractor restarts: {summary['extractor_restarts']}"
    )
    if strangers := summary.get("messages_of_strangers"):
        lines.append(strangers_sentence(strangers))
    warnings = parts_sentences(summary) + summary["warnings"] + summary["not_written"]
    return lines + [f"warning: {warning}" for warning in warnings]


def _describe_loop_checks(summary: Summary) -> str:
    """How many candidates for a loop passed each check; empty without candidates."""
    counts = (summary.get("stage_values") or {}).get("loop_closer", {})
    if not counts.get("loop_candidates"):
        return ""
    candidates, consistent, matched, aligned, confirmed = (
        int(counts.get(f"loop_{name}", 0)) for name in ("candidates", "consistent", "matched", "aligned", "confirmed")
    )
    contradicted = int(counts.get("loop_contradicted", 0))
    return (
        f"loop candidates: {candidates} places looked alike, {consistent} also from the keyframes before, "
        f"{matched} shared enough landmarks, {aligned} agreed on the camera's pose, {confirmed} were confirmed"
        + (f", {contradicted} refused since they contradict the map" if contradicted else "")
    )


def _describe_times(name: str, milliseconds: dict[str, Any] | None) -> str:
    if not milliseconds:
        return f"{name}: not measured"
    return f"{name}: median {milliseconds['median']:.1f} ms, 95 % {milliseconds['p95']:.1f} ms"
