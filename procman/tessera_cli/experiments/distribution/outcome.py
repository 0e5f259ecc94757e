"""A distribution experiment as its folder holds it."""

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from tessera_cli.errors import UserError
from tessera_cli.experiments.distribution.calibration import Calibration, read_calibration
from tessera_cli.experiments.distribution.figures import Cell, Figures, read_figures
from tessera_cli.experiments.distribution.grid import EXPERIMENTS, Configuration, Experiment, read_key, tile_count
from tessera_cli.experiments.plan import DESCRIPTION, RUNS, ExperimentFolder

CALIBRATION = "calibration.json"
TEN_HZ_PERIOD_MS = 100.0


@dataclass(frozen=True)
class Outcome:
    """All runs that came to their end."""

    name: str  # of the folder
    path: Path
    experiment: Experiment
    sequence: str
    cells: dict[Configuration, Cell]
    calibration: Calibration | None  # of slow nodes
    settings: list[str] = field(default_factory=list)  # section.key=value, of all runs

    @property
    def extractors(self) -> list[int]:
        return sorted({each.extractors for each in self.cells})

    @property
    def cuts(self) -> list[str]:
        return sorted({each.tiles for each in self.cells}, key=lambda tiles: (tile_count(tiles), tiles))

    @property
    def num_frames(self) -> int:
        return max(run.measurement.frames for cell in self.cells.values() for run in cell.runs)

    def cell(self, extractors: int, tiles: str, variant: str = "") -> Cell | None:
        return self.cells.get(Configuration(extractors, tiles, variant))

    def of_variant(self, *variants: str) -> list[Cell]:
        """Coarse cuts first, then few extractors first."""
        chosen = [cell for each, cell in self.cells.items() if each.variant in variants]
        return sorted(chosen, key=lambda cell: (cell.configuration.num_tiles, cell.configuration.extractors))

    def host_cores_at_10_hz(self, cell: Cell) -> float:
        """That the estimating host would use: c - b p of a frame's CPU time c came with the frame, b with its time p.

        b, what processes need while no frame comes, is a fit to all runs of the same cut:  c = a + b p  (a, b >= 0), by
        least squares. Without it, nodes that are slower than 10 Hz would make the host look busier.
        """
        idle_cores = self._idle_host_cores(cell.configuration.tiles)

        def cores(run: Figures) -> float:
            of_frame_ms = run.host_cpu_ms - idle_cores * run.measurement.period_ms
            return of_frame_ms / TEN_HZ_PERIOD_MS + idle_cores

        return cell.median(cores)

    def _idle_host_cores(self, tiles: str) -> float:
        """0 where all runs are faster than 10 Hz, from which it can't be told."""
        runs = [run for cell in self.of_variant("") if cell.configuration.tiles == tiles for run in cell.runs]
        periods_ms = np.array([run.measurement.period_ms for run in runs])
        if len(runs) < 2 or np.max(periods_ms) < TEN_HZ_PERIOD_MS:
            return 0.0
        (_, idle_cores), _ = nnls(np.stack([np.ones(len(runs)), periods_ms], axis=1), [run.host_cpu_ms for run in runs])
        return float(idle_cores)

    @property
    def hashes(self) -> set[tuple[str, str]]:
        """Of trajectory and map, over all runs; a law of the project wants one."""
        return set().union(*(cell.hashes for cell in self.cells.values()))


def read_outcome(path: Path) -> Outcome:
    """Raises UserError if the folder holds no distribution experiment with a run."""
    try:
        description = json.loads((path / DESCRIPTION).read_text())
        experiment, sequence = EXPERIMENTS[description["experiment"]], description["sequences"][0]
    except (OSError, ValueError, KeyError, IndexError, TypeError) as error:
        known = ", ".join(EXPERIMENTS)
        raise UserError(f"{path} holds no experiment of these: {known} (of tessera experiment NAME --out).") from error
    runs: dict[Configuration, list[Path]] = {}
    for folder in sorted((path / RUNS).glob("*/*")):
        configuration = read_key(folder.name.rpartition("-")[0])
        if configuration:
            runs.setdefault(configuration, []).append(folder)
    cells = {}
    for configuration, folders in runs.items():
        if figures := [each for folder in folders if (each := read_figures(folder))]:
            cells[configuration] = Cell(configuration, figures)
    if not cells:
        raise UserError(f"{path} holds no run that came to its end.")
    title = f"{sequence['name']} {sequence['sensor']}"
    settings = description.get("settings", [])
    return Outcome(path.name, path, experiment, title, cells, read_calibration(path / CALIBRATION), settings)


def folder_of(outcome: Outcome, configuration: Configuration) -> Path:
    """Of one run of it."""
    folders = sorted((ExperimentFolder(outcome.path).path / RUNS).glob(f"*/{configuration.key}-*"))
    return folders[0]
