"""Experiment latency: from the capture of a frame to its pose in live runs, against load, rate, extractors and cuts."""

import csv
import itertools
import json
import os
import subprocess
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tessera_cli.console import say
from tessera_cli.experiments.checkouts import this_checkout
from tessera_cli.experiments.commands import CommandRunner
from tessera_cli.experiments.plan import Sequence, sequences_of
from tessera_cli.experiments.runner import RunOptions
from tessera_cli.experiments.targets import STANDARD
from tessera_cli.files import write_text
from tessera_cli.interrupt import Interrupt
from tessera_cli.runs.run_folder import new_folder

NUM_SEQUENCES = 2  # of the standard ones: KITTI 03 mono and EuRoC stereo
RATES = (1, 3)  # times that of the source
EXTRACTORS_AND_TILES = ((1, "1x1"), (2, "1x1"), (2, "2x1"))
HEADING = (
    "| sequence | other programs | rate | extractors | tiles | median ms | p99 ms | p99 / interval | dropped | lost |"
)


@dataclass(frozen=True)
class Condition:
    """Of one run."""

    sequence: Sequence
    is_busy: bool  # another program takes what it gets of every core
    rate: int
    extractors: int
    tiles: str

    @property
    def name(self) -> str:
        load = "busy" if self.is_busy else "idle"
        return f"{self.sequence.key}_{load}_rate{self.rate}_p{self.extractors}_{self.tiles}"


def measure_latency(arguments: Namespace) -> int:
    """`tessera experiment latency`."""
    sequences = sequences_of(arguments, STANDARD[:NUM_SEQUENCES])
    folder = new_folder("experiment-latency")
    folder.mkdir(parents=True, exist_ok=True)
    grid = itertools.product(sequences, (False, True), RATES, EXTRACTORS_AND_TILES)
    commands = CommandRunner(folder / "logs", Interrupt())
    rows = []
    for sequence, is_busy, rate, (extractors, tiles) in grid:
        condition = Condition(sequence, is_busy, rate, extractors, tiles)
        say(condition.name)
        with _load(is_busy):
            _run(condition, arguments, commands, folder / condition.name)
        rows.append(_row(condition, folder / condition.name))
        print(rows[-1], flush=True)
    table = "\n".join([HEADING, "|---" * HEADING.count(" |") + "|", *rows]) + "\n"
    write_text(folder / "latency.md", table)
    print(f"\n{table}\nTable and runs: {folder}")
    return 0


@contextmanager
def _load(is_busy: bool) -> Iterator[None]:
    """One endless loop for each core."""
    number = (os.cpu_count() or 1) if is_busy else 0
    loops = [subprocess.Popen(["sh", "-c", "while :; do :; done"]) for _ in range(number)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def _run(condition: Condition, arguments: Namespace, commands: CommandRunner, folder: Path) -> None:
    here, options = this_checkout(), RunOptions(condition.extractors, arguments.frames, arguments.port)
    words = options.words(condition.sequence, condition.sequence.source, folder)
    words += ["--live", "--pace", str(condition.rate), "--tiles", condition.tiles]
    commands.run(condition.name, [*here.words, *words], here.folder, here.environment, lambda _: None, folder)


def _row(condition: Condition, folder: Path) -> str:
    summary: dict[str, Any] = json.loads((folder / "summary.json").read_text())
    with open(folder / "frames.csv", newline="") as file:
        times_us = [float(row["utime_us"]) for row in csv.DictReader(file)]
    interval_ms = float(np.min(np.diff(times_us))) / 1000 / condition.rate
    latency = summary["latency_ms"]
    columns = (
        condition.sequence.title,
        "on every core" if condition.is_busy else "none",
        f"{1000 / interval_ms:.0f} Hz",
        condition.extractors,
        condition.tiles,
        f"{latency['median']:.0f}",
        f"{latency['p99']:.0f}",
        f"{latency['p99'] / interval_ms:.1f}",
        summary["frames_dropped"],
        summary["frames_lost"],
    )
    return "| " + " | ".join(map(str, columns)) + " |"
