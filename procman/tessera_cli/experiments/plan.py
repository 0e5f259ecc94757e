"""What an experiment runs, in which order, and the folder that remembers what is done.

Runs of two checkouts alternate, so that a machine that slows down slows both: A, B, A, B, ... of each sequence, and the
first repetition of all sequences before the second.
"""

import json
import re
import shutil
from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tessera_cli.console import say
from tessera_cli.errors import UserError
from tessera_cli.files import absolute, write_text
from tessera_cli.runs.run_folder import Summary, new_folder
from tessera_cli.runs.sources import parse_source

THIS, THAT = "this", "that"
DESCRIPTION = "experiment.json"
# Its keys, in a sentence that says what differs.
MEANINGS = {THIS: "build of this checkout", THAT: "commit to compare with", "extractors": "number of extractors"}
# What it holds besides results.
RUNS, RECORDINGS, LOGS = "runs", "recordings", "logs"


@dataclass(frozen=True)
class Sequence:
    """One source and the images that are used of it."""

    name: str  # for people
    sensor: str
    source: str  # as `tessera run` takes it
    max_error_m: float | None = None  # target for the whole sequence

    @property
    def title(self) -> str:
        return f"{self.name} {'RGB-D' if self.sensor == 'rgbd' else self.sensor}"

    @property
    def key(self) -> str:
        """Of its folders and files."""
        return re.sub(r"[^A-Za-z0-9]+", "_", f"{self.name} {self.sensor}").strip("_").lower()


@dataclass(frozen=True)
class PlannedRun:
    """One run of one checkout."""

    sequence: Sequence
    side: str  # THIS or THAT
    repetition: int  # from 1

    @property
    def name(self) -> str:
        return f"{self.sequence.key}_{self.side}_{self.repetition}"


def alternate(sequences: list[Sequence], sides: list[str], repetitions: int) -> list[PlannedRun]:
    """All runs in their order."""
    return [
        PlannedRun(sequence, side, repetition)
        for repetition in range(1, repetitions + 1)
        for sequence in sequences
        for side in sides
    ]


def choose_sequences(
    specs: list[tuple[str, str]], standard: list[Sequence], data: Path
) -> tuple[list[Sequence], list[str]]:
    """Those of --source (sensor, source), else the standard ones that are there, and a sentence for each that isn't.

    `standard`: their folders are relative to `data`. Raises UserError for a source that is malformed or missing, and
    for two of one name.
    """
    absent = []
    chosen = [_own_sequence(sensor, text) for sensor, text in specs]
    for each in [] if specs else standard:
        kind, _, place = each.source.partition(":")
        folder = data / place
        if kind == "sim":
            chosen.append(each)
        elif folder.is_dir():
            chosen.append(Sequence(each.name, each.sensor, f"{kind}:{folder}", each.max_error_m))
        else:
            absent.append(f"{each.name} is left out: there is no folder {folder} (--data DIR says where the data are)")
    keys = [sequence.key for sequence in chosen]
    if len(set(keys)) < len(keys):
        raise UserError("--source: a sequence is given twice with the same sensor.")
    return chosen, absent


def sequences_of(arguments: Namespace, standard: list[Sequence]) -> list[Sequence]:
    """What --source and --data choose. Those that are left out are told; raises UserError if nothing is left."""
    sequences, absent = choose_sequences(arguments.sources, standard, absolute(arguments.data))
    for sentence in absent:
        say(sentence)
    if not sequences:
        raise UserError("no sequence is left to be measured.")
    return sequences


def _own_sequence(sensor: str, text: str) -> Sequence:
    source = parse_source(text)
    if source.is_live or source.kind == "bus":
        raise UserError(f"--source {text}: it has no end, and no two runs of it are the same; record it first.")
    # Options of a simulated world make another one.
    name = source.text.removeprefix("sim:") if source.kind == "sim" else source.name
    return Sequence(name, sensor, source.text)


class ExperimentFolder:
    """The folder of one experiment, on the disk."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def run_path(self, run: PlannedRun) -> Path:
        return self.path / RUNS / run.sequence.key / f"{run.side}-{run.repetition}"

    def recording_path(self, sequence: Sequence, side: str) -> Path:
        return self.path / RECORDINGS / f"{sequence.key}-{side}"

    @property
    def logs(self) -> Path:
        return self.path / LOGS

    def begin(self, description: dict[str, Any]) -> None:
        """A new experiment: runs of an earlier one are removed."""
        for name in (RUNS, RECORDINGS):
            shutil.rmtree(self.path / name, ignore_errors=True)
        self.path.mkdir(parents=True, exist_ok=True)
        write_text(self.path / DESCRIPTION, json.dumps(description, indent=2) + "\n")

    def summary(self, run: PlannedRun) -> Summary | None:
        """None: the run has not ended well yet."""
        return read_complete(self.run_path(run))


def read_complete(folder: Path) -> Summary | None:
    """The summary of a run that came to its end; None if there is none."""
    try:
        summary = json.loads((folder / "summary.json").read_text())
    except (OSError, ValueError):
        return None
    return summary if summary.get("ended") == "complete" else None


def check_out(out: str | None, force: bool) -> None:
    """Raises UserError if --out holds anything but an experiment and `force` is not given. To be called early."""
    path = absolute(out) if out else None
    if path is None or not path.exists():
        return
    if not path.is_dir():
        raise UserError(f"--out {out}: this is a file; name a folder.")
    if any(path.iterdir()) and not force and _read_description(path) is None:
        raise UserError(f"--out {out}: the folder is not empty; name another one, or add --force.")


def open_folder(out: str | None, name: str, description: dict[str, Any], force: bool) -> tuple[ExperimentFolder, bool]:
    """The folder, and whether it holds an experiment of this description, which is continued. Changes nothing yet.

    `out`: of --out; None: a new folder under logs/. Raises UserError if it holds another one and `force` is not given.
    """
    check_out(out, force)
    path = absolute(out) if out else new_folder(name)
    found = _read_description(path)
    if force or found is None:
        return ExperimentFolder(path), False
    if differing := [MEANINGS.get(key, key) for key in description if found.get(key) != description[key]]:
        raise UserError(
            f"--out {out} holds an experiment with another {' and '.join(differing)}: "
            "name another folder, or add --force to replace it."
        )
    return ExperimentFolder(path), True


def _read_description(path: Path) -> dict[str, Any] | None:
    try:
        found = json.loads((path / DESCRIPTION).read_text())
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None
