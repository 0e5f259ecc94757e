"""report.html: one or several results for people, in one file that needs no network."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from tessera_cli.report import figures, sentences
from tessera_cli.report.drawing import in_order
from tessera_cli.report.page import write_page
from tessera_cli.report.svg import NUM_SERIES
from tessera_cli.runs.run_folder import Result, Summary
from tessera_cli.runs.trajectories import TrajectoryError, length_m
from tessera_cli.settings import DEFAULTS_PATH, Settings, without_password

NOTHING = "–"


@dataclass(frozen=True)
class Setting:
    """One setting of a run."""

    key: str
    value: str
    default: str  # empty: it has none
    differs: bool


def write_report(results: list[Result], path: Path) -> None:
    """`results`: at least one. The file is written whole or not at all."""
    write_page(
        path,
        "report.html",
        title=_title(results),
        results=[_describe(result, index) for index, result in enumerate(results)],
        drawings=figures.draw_all(results),
        figures_of_all=_figures_of_all(results),
        tiles=_tiles(results[0]),
        alone=len(results) == 1,
    )


def _title(results: list[Result]) -> str:
    return results[0].name if len(results) == 1 else f"{len(results)} trajectories compared"


def _describe(result: Result, index: int) -> dict[str, Any]:
    """What the template shows of one result."""
    settings, summary = _settings(result), result.summary
    hashes = {"trajectory": summary.get("trajectory_sha256"), "map": summary.get("map_sha256")}
    return {
        "name": result.name,
        "color": index % NUM_SERIES + 1,
        "subtitle": _subtitle(summary),
        "headline": sentences.headline(result),
        "remarks": sentences.remarks(result),
        "has_run": bool(summary),
        "processes": _processes(summary),
        "settings": settings,
        "changed": [setting for setting in settings if setting.differs],
        "versions": summary.get("versions", {}),
        "hashes": {name: value for name, value in hashes.items() if value},
    }


def _subtitle(summary: Summary) -> str:
    if not summary:
        return ""
    tiles = f"{summary['tiles']} tiles" if summary["tiles"] != "1x1" else "whole images"
    extractors = sentences.count(summary["extractors"], "extractor")
    return f"{summary['source']}, {summary['sensor']}, {extractors}, {tiles}"


def _tiles(result: Result) -> list[tuple[str, str]]:
    """The most important figures."""
    summary, error = result.summary, result.error
    tiles = [
        ("RMS error", _text(error.rms_m if error else None, "{:.3f} m")),
        ("frames per second", _text(summary.get("frames_per_s"), "{:.1f}")),
        ("frames tracked", _text(summary.get("frames_tracked"), "{:,}") + _text(summary.get("frames"), " of {:,}")),
        ("loops closed", _text(sentences.num_loops(result), "{:,}")),
        ("tracking failures", _text(summary.get("tracking_failures"), "{:,}")),
        ("keyframes", _text(summary.get("keyframes"), "{:,}")),
        ("landmarks", _text(summary.get("landmarks"), "{:,}")),
    ]
    if error and not summary:
        tiles += [
            ("largest error", f"{error.errors_m.max():.3f} m"),
            ("path length", f"{length_m(error.truth):,.1f} m"),
            ("poses compared", f"{len(error.errors_m):,}"),
        ]
    return [(name, value) for name, value in tiles if NOTHING not in value]


def _figures_of_all(results: list[Result]) -> list[tuple[str, list[str]]]:
    """Rows of a table: a name, and its value for each result. Rows without any value are left out."""

    def from_summary(key: str, pattern: str = "{:,}") -> list[str]:
        return [_text(result.summary.get(key), pattern) for result in results]

    def of_times(key: str, statistic: str) -> list[str]:
        return [_text((result.summary.get(key) or {}).get(statistic), "{:.1f} ms") for result in results]

    def of_error(measure: Callable[[TrajectoryError], float], pattern: str = "{:.3f} m") -> list[str]:
        return [_text(measure(result.error) if result.error else None, pattern) for result in results]

    rows = [
        ("RMS error", of_error(lambda error: error.rms_m)),
        ("median error", of_error(lambda error: float(sorted(error.errors_m)[len(error.errors_m) // 2]))),
        ("largest error", of_error(lambda error: float(error.errors_m.max()))),
        ("alignment", [_alignment(result) for result in results]),
        ("path length", of_error(lambda error: length_m(error.truth), "{:,.1f} m")),
        ("frames", from_summary("frames")),
        ("frames tracked", from_summary("frames_tracked")),
        ("frames lost", from_summary("frames_lost")),
        ("frames dropped", from_summary("frames_dropped")),
        ("tracking failures", from_summary("tracking_failures")),
        ("loops closed", [_text(sentences.num_loops(result), "{:,}") for result in results]),
        ("relocalizations", from_summary("relocalizations")),
        ("frames per second", from_summary("frames_per_s", "{:.1f}")),
        ("duration", from_summary("wall_s", "{:.1f} s")),
        ("pose time, median", of_times("pose_time_ms", "median")),
        ("pose time, 95 %", of_times("pose_time_ms", "p95")),
        ("latency, median", of_times("latency_ms", "median")),
        ("latency, 95 %", of_times("latency_ms", "p95")),
        ("latency, 99 %", of_times("latency_ms", "p99")),
        ("wait for the map, 95 %", of_times("map_wait_ms", "p95")),
        ("parts of the map", from_summary("map_parts")),
        ("keyframes in the map", from_summary("keyframes")),
        ("landmarks", from_summary("landmarks")),
        ("messages repaired", from_summary("messages_repaired")),
        ("messages lost", from_summary("messages_lost")),
    ]
    return [(name, values) for name, values in rows if any(value != NOTHING for value in values)]


def _alignment(result: Result) -> str:
    error = result.error
    if error is None:
        return NOTHING
    return error.alignment if error.alignment == "SE(3)" else f"{error.alignment}, scale {error.scale:.4g}"


def _text(value: float | None, pattern: str) -> str:
    return NOTHING if value is None else pattern.format(value)


def _processes(summary: Summary) -> list[tuple[str, ...]]:
    """Rows of a table: process, CPU s, share of a core, MB, median and 95 % of its steps in ms."""
    wall_s = summary.get("wall_s") or 0.0
    rows: list[tuple[str, ...]] = []
    cpu_of, memory_of = summary.get("cpu_s") or {}, summary.get("max_rss_mb") or {}
    for name in in_order(cpu_of):
        step = (summary.get("stage_ms") or {}).get(name) or {}
        share = f"{100 * cpu_of[name] / wall_s:.0f} %" if wall_s > 0 else NOTHING
        memory, times = _text(memory_of.get(name), "{:.0f}"), (step.get("median"), step.get("p95"))
        rows.append((name, f"{cpu_of[name]:.2f}", share, memory, *(_text(time, "{:.2f}") for time in times)))
    return rows


def _settings(result: Result) -> list[Setting]:
    """All settings of the run, compared with the defaults of this checkout."""
    if not result.settings:
        return []
    defaults = _flat(yaml.safe_load(DEFAULTS_PATH.read_text()))
    return [
        Setting(key, _plain(value), _plain(defaults[key]) if key in defaults else "", defaults.get(key) != value)
        for key, value in _flat(result.settings).items()
    ]


def _flat(sections: Settings) -> dict[str, Any]:
    return {f"{section}.{key}": value for section, keys in sections.items() for key, value in (keys or {}).items()}


def _plain(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return '""' if value == "" else without_password(str(value))
