"""report.html: one or several results for people, in one file that needs no network."""

from dataclasses import dataclass
from pathlib import Path

import yaml
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from tessera_cli.files import ROOT, write_text
from tessera_cli.report import figures
from tessera_cli.report import sentences as words
from tessera_cli.report.drawing import NUM_SERIES, in_order
from tessera_cli.runs.run_folder import Result
from tessera_cli.runs.trajectories import length_m

TEMPLATES = Path(__file__).parent / "templates"
NOTHING = "–"


@dataclass(frozen=True)
class Setting:
    key: str
    value: str
    default: str  # empty: it has none
    differs: bool


def write_report(results: list[Result], path: Path) -> None:
    """`results`: at least one. The file appears whole or not at all."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    drawings = figures.draw_all(results)
    write_text(
        path,
        environment.get_template("report.html").render(
            title=_title(results),
            results=[_describe(result, index) for index, result in enumerate(results)],
            drawings=drawings,
            figures_of_all=_figures_of_all(results),
            tiles=_tiles(results[0]),
            alone=len(results) == 1,
        ),
    )


def _title(results: list[Result]) -> str:
    return results[0].name if len(results) == 1 else f"{len(results)} trajectories beside each other"


def _describe(result: Result, index: int) -> dict:
    """What the template shows of one result."""
    settings = _settings(result)
    return {
        "name": result.name,
        "color": index % NUM_SERIES + 1,
        "subtitle": _subtitle(result),
        "headline": words.headline(result),
        "remarks": words.remarks(result),
        "has_run": bool(result.summary),
        "processes": _processes(result.summary),
        "settings": settings,
        "changed": [setting for setting in settings if setting.differs],
        "versions": result.summary.get("versions", {}),
        "hashes": {
            name: result.summary[key]
            for name, key in (("trajectory", "trajectory_sha256"), ("map", "map_sha256"))
            if result.summary.get(key)
        },
    }


def _subtitle(result: Result) -> str:
    summary = result.summary
    if not summary:
        return ""
    cut = f"{summary['tiles']} tiles" if summary["tiles"] != "1x1" else "whole images"
    return f"{summary['source']}, {summary['sensor']}, {words.count(summary['extractors'], 'extractor')}, {cut}"


def _tiles(result: Result) -> list[tuple[str, str]]:
    """The figures that people ask for first."""
    summary, error = result.summary, result.error
    tiles = [
        ("RMS error", _text(error.rms_m if error else None, "{:.3f} m")),
        ("frames per second", _text(summary.get("frames_per_s"), "{:.1f}")),
        ("frames tracked", _text(summary.get("frames_tracked"), "{:,}") + _text(summary.get("frames"), " of {:,}")),
        ("loops closed", _text(words.num_loops(result), "{:,}")),
        ("tracking failures", _text(summary.get("tracking_failures"), "{:,}")),
        ("keyframes", _text(summary.get("keyframes"), "{:,}")),
        ("landmarks", _text(summary.get("landmarks"), "{:,}")),
    ]
    if error and not summary:
        tiles += [
            ("greatest error", f"{error.errors_m.max():.3f} m"),
            ("length of the way", f"{length_m(error.truth):,.1f} m"),
            ("poses compared", f"{len(error.errors_m):,}"),
        ]
    return [(name, value) for name, value in tiles if NOTHING not in value]


def _figures_of_all(results: list[Result]) -> list[tuple[str, list[str]]]:
    """Rows of a table: what it is, and its value for each result. Rows without any value are left out."""

    def from_summary(key: str, pattern: str = "{:,}"):
        return [_text(result.summary.get(key), pattern) for result in results]

    def of_times(key: str, statistic: str):
        return [_text((result.summary.get(key) or {}).get(statistic), "{:.1f} ms") for result in results]

    def of_error(measure):
        return [_text(measure(result.error) if result.error else None, "{:.3f} m") for result in results]

    rows = [
        ("RMS error", of_error(lambda error: error.rms_m)),
        ("median error", of_error(lambda error: float(sorted(error.errors_m)[len(error.errors_m) // 2]))),
        ("greatest error", of_error(lambda error: float(error.errors_m.max()))),
        ("alignment", [_alignment(result) for result in results]),
        (
            "length of the way",
            [_text(length_m(result.error.truth) if result.error else None, "{:,.1f} m") for result in results],
        ),
        ("frames", from_summary("frames")),
        ("frames tracked", from_summary("frames_tracked")),
        ("frames lost", from_summary("frames_lost")),
        ("frames dropped", from_summary("frames_dropped")),
        ("tracking failures", from_summary("tracking_failures")),
        ("loops closed", [_text(words.num_loops(result), "{:,}") for result in results]),
        ("relocalisations", from_summary("relocalizations")),
        ("frames per second", from_summary("frames_per_s", "{:.1f}")),
        ("duration", from_summary("wall_s", "{:.1f} s")),
        ("pose time, median", of_times("pose_time_ms", "median")),
        ("pose time, 95 %", of_times("pose_time_ms", "p95")),
        ("latency, median", of_times("latency_ms", "median")),
        ("latency, 95 %", of_times("latency_ms", "p95")),
        ("wait for the map, 95 %", of_times("map_wait_ms", "p95")),
        ("keyframes in the map", from_summary("keyframes")),
        ("landmarks", from_summary("landmarks")),
        ("messages repaired", from_summary("messages_repaired")),
        ("messages lost", from_summary("messages_lost")),
    ]
    return [(name, values) for name, values in rows if any(value != NOTHING for value in values)]


def _alignment(result: Result) -> str:
    if result.error is None:
        return NOTHING
    return (
        result.error.alignment
        if result.error.alignment == "SE(3)"
        else f"{result.error.alignment}, scale {result.error.scale:.4g}"
    )


def _text(value, pattern: str) -> str:
    return NOTHING if value is None else pattern.format(value)


def _processes(summary: dict) -> list[tuple[str, ...]]:
    """Rows of a table: process, CPU s, share of a core, MB, step's median and 95 % in ms."""
    wall_s, rows = summary.get("wall_s") or 0.0, []
    cpu_of = summary.get("cpu_s") or {}
    for name in in_order(list(cpu_of)):
        step = (summary.get("stage_ms") or {}).get(name) or {}
        rows.append(
            (
                name,
                f"{cpu_of[name]:.2f}",
                f"{100 * cpu_of[name] / wall_s:.0f} %" if wall_s > 0 else NOTHING,
                _text((summary.get("max_rss_mb") or {}).get(name), "{:.0f}"),
                _text(step.get("median"), "{:.2f}"),
                _text(step.get("p95"), "{:.2f}"),
            )
        )
    return rows


def _settings(result: Result) -> list[Setting]:
    """All settings of the run, against the defaults of this checkout."""
    if not result.settings:
        return []
    defaults = _flat(yaml.safe_load((ROOT / "config" / "default.yaml").read_text()))
    return [
        Setting(key, _plain(value), _plain(defaults[key]) if key in defaults else "", defaults.get(key) != value)
        for key, value in _flat(result.settings).items()
    ]


def _flat(sections: dict) -> dict:
    return {f"{section}.{key}": value for section, keys in sections.items() for key, value in (keys or {}).items()}


def _plain(value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return '""' if value == "" else str(value)
