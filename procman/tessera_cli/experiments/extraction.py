"""Experiment extraction: time per image, compared with cv::ORB, as a table, a CSV file and a plot."""

import csv
import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from rich import box
from rich.console import Console
from rich.table import Table

from tessera_cli.console import say
from tessera_cli.errors import RunError
from tessera_cli.files import BUILD, replacing
from tessera_cli.report.trajectory_plot import save_png
from tessera_cli.runs.run_folder import new_folder

BENCHMARK = BUILD / "tests" / "benchmarks" / "features_benchmark"
REFERENCE = "CvOrb"
WHOLE = "Extraction/whole"
# The median of so many interleaved repetitions: a short disturbance of the machine affects only a few of them.
REPETITIONS = 5
TABLE_WIDTH = 130
# What some benchmarks count besides time.
COUNTERS = ("keypoints", "candidates", "wire_kB", "repeatability")


@dataclass(frozen=True)
class Row:
    """One benchmark."""

    name: str
    cpu_ms: float  # median over the repetitions of the mean per image, one thread
    of_reference: float  # times cv::ORB
    of_whole: float  # times the uncut mono image
    counters: dict[str, float]


def measure_extraction() -> int:
    say(f"measuring extraction, {REPETITIONS} repetitions on one thread; takes a minute or two")
    rows = _to_rows(_run_benchmark())
    folder = new_folder("experiment-extraction")
    folder.mkdir(parents=True, exist_ok=True)
    _print_table(rows)
    _write_csv(rows, folder / "extraction.csv")
    _plot(rows, folder / "extraction.png")
    print(f"\nTable and plot: {folder}")
    return 0


def _run_benchmark() -> list[dict[str, Any]]:
    if not BENCHMARK.is_file():
        raise RunError(f"{BENCHMARK} is missing; procman/tessera setup builds it.")
    options = [
        "--benchmark_format=json",
        f"--benchmark_repetitions={REPETITIONS}",
        "--benchmark_enable_random_interleaving=true",
        "--benchmark_min_time=0.3",
    ]
    finished = subprocess.run([BENCHMARK, *options], capture_output=True, text=True)
    if finished.returncode != 0:
        raise RunError(f"{BENCHMARK.name} failed: {finished.stderr.strip().splitlines()[-1:]}")
    return json.loads(finished.stdout)["benchmarks"]


def _to_rows(results: list[dict[str, Any]]) -> list[Row]:
    medians = {result["run_name"]: result for result in results if result.get("aggregate_name") == "median"}
    if REFERENCE not in medians or WHOLE not in medians:
        raise RunError(f"{BENCHMARK.name} measured neither {REFERENCE} nor {WHOLE}.")
    reference_ms, whole_ms = medians[REFERENCE]["cpu_time"], medians[WHOLE]["cpu_time"]
    return [
        Row(
            name=name,
            cpu_ms=result["cpu_time"],
            of_reference=result["cpu_time"] / reference_ms,
            of_whole=result["cpu_time"] / whole_ms,
            counters={counter: result[counter] for counter in COUNTERS if counter in result},
        )
        for name, result in sorted(medians.items())  # they come in random order
    ]


def _print_table(rows: list[Row]) -> None:
    counters = [counter for counter in COUNTERS if any(counter in row.counters for row in rows)]
    title = "Time per KITTI image, 2000 keypoints, one thread"
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1))
    table.add_column("what", no_wrap=True)
    for heading in ("CPU ms", "x cv::ORB", "x whole", *counters):
        table.add_column(heading, justify="right")
    for row in rows:
        figures = [f"{row.counters[counter]:.4g}" if counter in row.counters else "" for counter in counters]
        table.add_row(row.name, f"{row.cpu_ms:.2f}", f"{row.of_reference:.2f}", f"{row.of_whole:.2f}", *figures)
    console = Console()
    console.width = max(console.width, TABLE_WIDTH)  # figures must not be cut off where there is no wide terminal
    console.print(table)


def _write_csv(rows: list[Row], path: Path) -> None:
    with replacing(path) as written, open(written, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["what", "cpu_ms", "times_cv_orb", "times_whole", *COUNTERS])
        for row in rows:
            counters = (row.counters.get(counter, "") for counter in COUNTERS)
            writer.writerow([row.name, row.cpu_ms, row.of_reference, row.of_whole, *counters])


def _plot(rows: list[Row], path: Path) -> None:
    figure = Figure(figsize=(9, 0.5 * len(rows) + 1.5), layout="constrained")
    axes = figure.subplots()
    axes.barh([row.name for row in rows], [row.cpu_ms for row in rows], color="tab:blue")
    reference_ms = next(row.cpu_ms for row in rows if row.name == REFERENCE)
    axes.axvline(reference_ms, color="black", linestyle="--", linewidth=1, label="cv::ORB")
    axes.invert_yaxis()
    axes.set_xlabel("CPU time per image [ms]")
    axes.grid(axis="x", alpha=0.3)
    axes.legend()
    save_png(figure, path)
