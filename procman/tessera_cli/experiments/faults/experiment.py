"""Experiment faults: one undisturbed run, then runs during which faults are thrown, until there were enough."""

import itertools
import json
import shutil
import time
from argparse import Namespace
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from tessera_cli.errors import RunError, UserError
from tessera_cli.experiments.checkouts import Checkout, this_checkout
from tessera_cli.experiments.commands import CommandRunner
from tessera_cli.experiments.distribution.cpu_groups import CpuGroups
from tessera_cli.experiments.distribution.faults import require_tools
from tessera_cli.experiments.distribution.lan import require_root
from tessera_cli.experiments.faults.network import enter_own_network
from tessera_cli.experiments.faults.outcome import (
    COMPLETE,
    Outcome,
    ThrownFault,
    attribute_pauses,
    longest_pause,
    read_outcome,
    write_outcome,
)
from tessera_cli.experiments.faults.page import write_faults_page
from tessera_cli.experiments.faults.schedule import LOSS, ROOT_KINDS, SLOW, Fault, deck, schedule
from tessera_cli.experiments.faults.tables import as_csv, as_json, headline, make_rows, print_table
from tessera_cli.experiments.faults.thrower import Thrower
from tessera_cli.experiments.plan import (
    ExperimentFolder,
    PlannedRun,
    Sequence,
    choose_sequences,
    open_folder,
    read_complete,
)
from tessera_cli.experiments.progress_view import ProgressView
from tessera_cli.experiments.rendering import render
from tessera_cli.experiments.series import NOT_KEPT
from tessera_cli.files import write_text
from tessera_cli.interrupt import Interrupt
from tessera_cli.lcm_bus import stack_bus_url

NAME = "experiment-faults"
UNDISTURBED, DISTURBED = "undisturbed", "disturbed"


def measure_faults(arguments: Namespace) -> int:
    """`tessera experiment faults`."""
    cards = deck(arguments.processes, arguments.kinds, arguments.extractors)
    if not cards:
        raise UserError("--kinds and --processes leave no fault: only extractors are slowed down.")
    _require(arguments.kinds)
    sequence = choose_sequences([arguments.source], [], Path())[0][0]
    checkout, interrupt = this_checkout(), Interrupt()
    description = _describe(arguments, sequence, checkout)
    folder, continues = open_folder(arguments.out, NAME, description, arguments.force)
    with ProgressView() as view, ExitStack() as stack:
        if LOSS in arguments.kinds:
            enter_own_network()
        groups = stack.enter_context(CpuGroups(1)) if SLOW in arguments.kinds else None
        if groups:
            groups.set_share(1.0)
        commands = CommandRunner(folder.logs, interrupt)
        if not continues:
            folder.begin(description)
        source = render(sequence, arguments.frames[1], checkout, commands, view)
        series = _Series(arguments, sequence, source, folder, checkout, commands, groups, view)
        try:
            series.carry_out(cards)
        except BaseException:
            view.say(f"what is done is kept: the same command with --out {folder.path} continues it")
            raise
    return _present(folder, sequence, series.undisturbed, series.runs)


def _require(kinds: list[str]) -> None:
    """Raises UserError if this user or machine can't make them."""
    if any(kind in ROOT_KINDS for kind in kinds):
        try:
            require_root("experiment faults")
        except UserError as error:
            raise UserError(f"{str(error).rstrip('.')}; or give --kinds kill stop.") from error
    if LOSS in kinds:
        require_tools()


def _describe(arguments: Namespace, sequence: Sequence, checkout: Checkout) -> dict[str, Any]:
    """What must be the same for runs to be put together; more faults may be added."""
    return {
        "experiment": "faults",
        "sequences": [{"name": sequence.name, "sensor": sequence.sensor, "source": sequence.source}],
        "this": checkout.fingerprint(),
        "frames": list(arguments.frames),
        "extractors": arguments.extractors,
        "seed": arguments.seed,
        "processes": arguments.processes,
        "kinds": arguments.kinds,
        "settings": arguments.settings,
    }


class _Series:
    """All runs of one experiment."""

    def __init__(
        self,
        arguments: Namespace,
        sequence: Sequence,
        source: str,
        folder: ExperimentFolder,
        checkout: Checkout,
        commands: CommandRunner,
        groups: CpuGroups | None,
        view: ProgressView,
    ) -> None:
        self._arguments, self._sequence, self._source, self._folder = arguments, sequence, source, folder
        self._checkout, self._commands, self._groups, self._view = checkout, commands, groups, view
        self.undisturbed = Outcome("", ("", ""), 0.0, [])
        self.runs: list[Outcome] = []

    def carry_out(self, cards: list[tuple[str, str]]) -> None:
        """Raises RunError if the undisturbed run fails, or is over before a fault could be thrown."""
        run = PlannedRun(self._sequence, UNDISTURBED, 1)
        self.undisturbed = read_outcome(self._folder.run_path(run)) or self._run(run, iter(()), 0, 0.0)
        if self.undisturbed.ended != COMPLETE:
            shutil.rmtree(self._folder.run_path(run))
            raise RunError(f"the undisturbed run did not end well: {self.undisturbed.ended}")
        until_s = time.monotonic() + 60 * self._arguments.minutes
        while True:
            run = PlannedRun(self._sequence, DISTURBED, len(self.runs) + 1)
            num_thrown = sum(len(each.faults) for each in self.runs)
            left = self._arguments.faults - num_thrown
            found = read_outcome(self._folder.run_path(run))
            if found is None and (left <= 0 or time.monotonic() >= until_s):
                return
            faults = itertools.islice(schedule(self._arguments.seed, cards), num_thrown, None)
            self.runs.append(found or self._run(run, faults, left, until_s))
            if not self.runs[-1].faults:
                raise RunError(f"{run.name} was over before a fault could be thrown; give a longer source.")

    def _run(self, run: PlannedRun, faults: Iterator[Fault], most: int, until_s: float) -> Outcome:
        """What came of it is kept in the run's folder. At most so many faults are thrown, none after `until_s`."""
        path, arguments, checkout = self._folder.run_path(run), self._arguments, self._checkout
        shutil.rmtree(path, ignore_errors=True)
        words = ["run", self._source, "--sensor", run.sequence.sensor, "--extractors", str(arguments.extractors)]
        words += ["--port", str(arguments.port), "--out", str(path)]
        words += [word for text in arguments.settings for word in ("--set", text)]
        first, last = arguments.frames
        words += ["--frames", f"{first}:{last if last >= 0 else ''}"]
        title = f"{run.sequence.title}, {run.side} {run.repetition}"
        self._view.begin(title)
        failure = ""
        with Thrower(
            path, stack_bus_url("main", arguments.port, False), faults, most, until_s, self._groups
        ) as thrower:

            def look(line: str) -> None:
                thrower.look()
                self._view.look(f"{len(thrower.thrown)} faults; {line}" if most else line)

            try:
                self._commands.run(
                    run.name, [*checkout.words, *words], checkout.folder, checkout.environment, look, path
                )
            except (RunError, UserError) as error:
                log = self._folder.logs / f"{run.name}.log"
                failure = str(error).rpartition(f"{log}: ")[2].removeprefix("tessera: ")  # what the command said
        for name in NOT_KEPT:
            (path / name).unlink(missing_ok=True)
        outcome = _judge(path, failure, thrower)
        write_outcome(path, outcome)
        self._view.say(f"{title}: {outcome.ended}; {len(outcome.faults)} faults, {_verdict(outcome, self.undisturbed)}")
        return outcome


def _judge(path: Path, failure: str, thrower: Thrower) -> Outcome:
    """`failure`: of the command; empty if it ended with status 0."""
    summary = read_complete(path)
    hashes = (summary["trajectory_sha256"] or "", summary["map_sha256"] or "") if summary else ("", "")
    start = thrower.pose_times[0] if thrower.pose_times else 0.0
    pauses = attribute_pauses(thrower.pose_times, [each.began_s for each in thrower.thrown])
    faults = [
        ThrownFault(each.process, each.kind, each.frame, each.began_s - start, each.ended_s - start, pause)
        for each, pause in zip(thrower.thrown, pauses)
    ]
    ended = failure or (COMPLETE if summary else "it left no summary")
    return Outcome(ended, hashes, longest_pause(thrower.pose_times), faults)


def _verdict(outcome: Outcome, undisturbed: Outcome) -> str:
    pause = f"longest pause {outcome.longest_pause_s:.1f} s"
    if not undisturbed.ended:
        return pause
    return f"{'the undisturbed' if outcome.is_like(undisturbed) else 'another'} trajectory and map, {pause}"


def _present(folder: ExperimentFolder, sequence: Sequence, undisturbed: Outcome, runs: list[Outcome]) -> int:
    """Prints the table and writes the results. Returns the exit status."""
    page = folder.path / "faults.html"
    rows = make_rows(undisturbed, runs)
    write_text(folder.path / "faults.json", json.dumps(as_json(undisturbed, runs), indent=2) + "\n")
    write_text(folder.path / "faults.csv", as_csv(undisturbed, runs))
    write_faults_page(page, sequence.title, undisturbed, runs)
    print_table(rows)
    for sentence in headline(undisturbed, runs):
        print(sentence)
    print(f"page: {page}, figures as faults.json and faults.csv beside it")
    return 0 if all(run.is_like(undisturbed) for run in runs) else 1
