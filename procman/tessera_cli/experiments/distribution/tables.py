"""Tables laid out like the paper's, cuts against number of extractors: on the terminal, and as CSV and JSON."""

import csv
import io
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from tessera_cli.experiments.distribution.claims import Claim
from tessera_cli.experiments.distribution.figures import Cell, Figures
from tessera_cli.experiments.distribution.grid import ALONE
from tessera_cli.experiments.distribution.outcome import Outcome

NOTHING = "–"


@dataclass(frozen=True)
class Grid:
    """One figure of all configurations, as texts: rows are cuts, columns numbers of extractors."""

    title: str
    note: str
    columns: list[int]
    rows: list[tuple[str, list[str]]]


def make_grids(outcome: Outcome) -> list[Grid]:
    host = "the estimating host" if outcome.experiment.extractors_per_host else "all stages but extractors"
    wire = (
        "on the link of the estimating host, both directions"
        if outcome.experiment.extractors_per_host
        else ("that processes of the one host send each other")
    )
    return [
        _grid(
            outcome, "Tracking failures – RMS error [m]", "All repetitions together; median of the error.", _failures
        ),
        _grid(outcome, "Poses per second", "Median over the repetitions; in brackets: times one extractor.", _speed),
        _grid(outcome, "Time between poses [ms]", "Mean / 95 % below / standard deviation.", _pose_times),
        _grid(
            outcome,
            "Latency of a frame that waits for no other [ms]",
            "Median / 95 % below; one frame at a time. More extractors than tiles are of no use to it.",
            _latency,
            ALONE,
        ),
        _grid(
            outcome,
            "CPU [ms per frame]",
            f"Of {host}; in brackets: cores at 10 Hz, what passes between frames is counted once.",
            _cpu,
        ),
        _grid(outcome, "Traffic [kB per frame]", f"Bytes {wire}; in brackets: times whole images.", _wire),
        _grid(outcome, "Messages repaired – lost", "Largest of the repetitions.", _messages),
        _grid(outcome, "What limits it", "Share of the time in which the busiest process works.", _limit),
    ]


Show = Callable[[Outcome, Cell], str]


def _grid(outcome: Outcome, title: str, note: str, show: Show, variant: str = "") -> Grid:
    rows = []
    for tiles in outcome.cuts:
        cells = [outcome.cell(number, tiles, variant) for number in outcome.extractors]
        rows.append((tiles, [show(outcome, cell) if cell else NOTHING for cell in cells]))
    return Grid(title, note, outcome.extractors, rows)


def _failures(_outcome: Outcome, cell: Cell) -> str:
    error = cell.median(lambda run: run.measurement.error_m)
    failures = sum(run.failures for run in cell.runs)
    return f"{failures} – {NOTHING if math.isnan(error) else f'{error:.3f}'}"


def _speed(outcome: Outcome, cell: Cell) -> str:
    speed = cell.median(lambda run: run.poses_per_s)
    one = outcome.cell(1, cell.configuration.tiles)
    times = f" ({speed / one.median(lambda run: run.poses_per_s):.1f}x)" if one else ""
    return f"{speed:.1f}{times}"


def _pose_times(_outcome: Outcome, cell: Cell) -> str:
    times = np.concatenate([run.pose_times_ms for run in cell.runs])
    return f"{np.mean(times):.0f}/{np.percentile(times, 95):.0f}/{np.std(times):.0f}"


def _latency(_outcome: Outcome, cell: Cell) -> str:
    times = np.concatenate([run.latencies_ms for run in cell.runs])
    return f"{np.median(times):.0f}/{np.percentile(times, 95):.0f}"


def _cpu(outcome: Outcome, cell: Cell) -> str:
    return f"{cell.median(lambda run: run.host_cpu_ms):.1f} ({outcome.host_cores_at_10_hz(cell):.2f})"


def _wire(outcome: Outcome, cell: Cell) -> str:
    wire = cell.median(lambda run: run.wire_kb)
    whole = outcome.cell(cell.configuration.extractors, "1x1")
    times = f" ({wire / whole.median(lambda run: run.wire_kb):.2f}x)" if whole else ""
    return f"{wire:.0f}{times}"


def _messages(_outcome: Outcome, cell: Cell) -> str:
    return f"{max(run.repaired for run in cell.runs)} – {max(run.lost for run in cell.runs)}"


def _limit(_outcome: Outcome, cell: Cell) -> str:
    name, share = busiest(cell.typical)
    return f"{name} {100 * share:.0f} %"


def busiest(run: Figures) -> tuple[str, float]:
    """The process that works for the largest share of the time; all extractors are one, by their mean."""
    measurement = run.measurement
    shares = {name: busy / measurement.period_ms for name, busy in measurement.busy_ms.items()}
    extractors = [share for name, share in shares.items() if name.startswith("extractor")]
    others = {name: share for name, share in shares.items() if not name.startswith("extractor")}
    if extractors:
        others["extractors"] = float(np.mean(extractors))
    return max(others.items(), key=lambda item: (item[1], item[0])) if others else ("unknown", float("nan"))


def print_outcome(outcome: Outcome, claims: list[Claim]) -> None:
    console = Console()
    for grid in make_grids(outcome):
        console.print(f"\n{grid.title}", style="bold", markup=False, highlight=False)
        console.print(grid.note, style="dim", markup=False, highlight=False)
        table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
        table.add_column("cut", no_wrap=True)
        for number in grid.columns:
            table.add_column(f"P = {number}", justify="right", overflow="fold")
        for tiles, texts in grid.rows:
            table.add_row(tiles, *texts)
        console.print(table)
    for claim in claims:
        console.print(claim.sentence, markup=False, highlight=False)


def as_markdown(outcome: Outcome) -> str:
    """The tables, for documents such as procman/EXPERIMENTS.md."""
    parts = []
    for grid in make_grids(outcome):
        heading = ["cut", *(f"P = {number}" for number in grid.columns)]
        rows = [heading, ["---"] * len(heading), *([tiles, *texts] for tiles, texts in grid.rows)]
        table = "".join(f"| {' | '.join(row)} |\n" for row in rows)
        parts.append(f"**{grid.title}.** {grid.note}\n\n{table}")
    return "\n".join(parts)


# Columns of the CSV file: what each run has besides its configuration.
COLUMNS: dict[str, Callable[[Figures], Any]] = {
    "tracking_failures": lambda run: run.failures,
    "rms_error_m": lambda run: run.measurement.error_m,
    "trajectory_sha256": lambda run: run.measurement.hashes[0],
    "map_sha256": lambda run: run.measurement.hashes[1],
    "frames": lambda run: run.measurement.frames,
    "poses_per_s": lambda run: _rounded(run.poses_per_s),
    "pose_time_mean_ms": lambda run: _rounded(np.mean(run.pose_times_ms)),
    "pose_time_p95_ms": lambda run: _rounded(np.percentile(run.pose_times_ms, 95)),
    "pose_time_std_ms": lambda run: _rounded(np.std(run.pose_times_ms)),
    "latency_median_ms": lambda run: _rounded(np.median(run.latencies_ms)),
    "latency_p95_ms": lambda run: _rounded(np.percentile(run.latencies_ms, 95)),
    "host_cpu_ms_per_frame": lambda run: _rounded(run.host_cpu_ms),
    "stack_cores": lambda run: _rounded(run.cores),
    "wire_kb_per_frame": lambda run: _rounded(run.wire_kb),
    "messages_repaired": lambda run: run.repaired,
    "messages_lost": lambda run: run.lost,
}


def _rounded(value: float) -> float:
    return round(float(value), 3)


def as_csv(outcome: Outcome) -> str:
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(["extractors", "tiles", "variant", "repetition", *COLUMNS])
    for cell in outcome.of_variant("", ALONE, *_fault_variants(outcome)):
        each = cell.configuration
        for number, run in enumerate(cell.runs, start=1):
            figures = [read(run) for read in COLUMNS.values()]
            writer.writerow([each.extractors, each.tiles, each.variant, number, *figures])
    return text.getvalue()


def _fault_variants(outcome: Outcome) -> list[str]:
    return sorted({each.variant for each in outcome.cells} - {"", ALONE})


def as_json(outcome: Outcome, claims: list[Claim], remarks: list[str]) -> dict[str, Any]:
    runs = []
    for cell in outcome.cells.values():
        for run in cell.runs:
            links = {f"node{host}": asdict(traffic) for host, traffic in run.traffic.items()}
            figures = {name: read(run) for name, read in COLUMNS.items()}
            runs.append(
                {**asdict(cell.configuration), **figures, "link_bytes": links, "cpu_ms": run.measurement.cpu_ms}
            )
    return {
        "experiment": outcome.experiment.name,
        "sequence": outcome.sequence,
        "calibration": asdict(outcome.calibration) if outcome.calibration else None,
        "remarks": remarks,
        "claims": [asdict(claim) for claim in claims],
        "tables": [asdict(grid) for grid in make_grids(outcome)],
        "runs": runs,
    }
