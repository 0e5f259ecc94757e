"""Distribution experiments that nobody made: their figures, and their folders."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from helpers.comparisons import make_measurement
from helpers.made_run import write_run
from tessera_cli.experiments.distribution.calibration import Calibration, write_calibration
from tessera_cli.experiments.distribution.figures import Cell, Figures
from tessera_cli.experiments.distribution.grid import ALONE, KILLED, LOSS, Configuration, Experiment
from tessera_cli.experiments.distribution.lan import Traffic
from tessera_cli.experiments.distribution.outcome import CALIBRATION, Outcome
from tessera_cli.experiments.distribution.runs import write_traffic
from tessera_cli.experiments.plan import DESCRIPTION, RUNS, Sequence

SEQUENCE = Sequence("a drive", "mono", "kitti:/a/drive")


def make_figures(poses_per_s: float = 5.0, latency_ms: float = 200.0, sent: int = 400_000, **changes: Any) -> Figures:
    """`sent`: bytes per frame of the first host."""
    measurement = make_measurement(**{"cpu_ms": {"camera": 4.0, "extractors": 8.0, "mapper": 16.0}, **changes})
    return Figures(
        measurement=measurement,
        failures=0,
        poses_per_s=poses_per_s,
        pose_times_ms=np.full(10, 1000 / poses_per_s),
        latencies_ms=np.full(10, latency_ms),
        traffic={1: Traffic(sent * measurement.frames, 100_000 * measurement.frames), 2: Traffic(0, 0)},
        repaired=0,
        lost=0,
    )


def make_outcome(experiment: Experiment, runs: Mapping[Configuration, list[Figures]]) -> Outcome:
    cells = {configuration: Cell(configuration, figures) for configuration, figures in runs.items()}
    calibration = Calibration(share=0.05, full_step_ms=10.0, step_ms=201.0) if experiment.is_slow else None
    return Outcome("made", Path("/made"), experiment, "a drive mono", cells, calibration)


def write_experiment(path: Path, experiment: Experiment) -> Path:
    """With two repetitions of two numbers of extractors and two cuts, and one run of each variant."""
    path.mkdir(parents=True)
    description = {
        "experiment": experiment.name,
        "sequences": [{"name": SEQUENCE.name, "sensor": SEQUENCE.sensor, "source": SEQUENCE.source}],
    }
    (path / DESCRIPTION).write_text(json.dumps(description))
    if experiment.is_slow:
        write_calibration(Calibration(0.05, 10.0, 201.0), path / CALIBRATION)
    plain = [Configuration(number, tiles) for number in (1, 4) for tiles in ("1x1", "2x2")]
    variants = [Configuration(4, "2x2", variant) for variant in (ALONE, KILLED, LOSS)]
    for configuration, repetition in [
        *((each, n) for each in plain for n in (1, 2)),
        *((each, 1) for each in variants),
    ]:
        folder = write_run(
            path / RUNS / SEQUENCE.key / f"{configuration.key}-{repetition}", sensor="mono", tracking_failures=0
        )
        hosts = range(1, experiment.num_hosts(4) + 1)
        write_traffic(folder, {host: Traffic(60_000_000, 12_000_000) for host in hosts})
    return path
