"""Experiments single, homogeneous and heterogeneous: the whole grid of runs, its tables and its page."""

import json
import os
from argparse import Namespace
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from tessera_cli.console import say
from tessera_cli.errors import UserError
from tessera_cli.experiments.checkouts import Checkout, this_checkout
from tessera_cli.experiments.commands import CommandRunner
from tessera_cli.experiments.distribution.calibration import (
    Calibration,
    calibrate,
    check_room,
    read_calibration,
    write_calibration,
)
from tessera_cli.experiments.distribution.claims import check_claims
from tessera_cli.experiments.distribution.cpu_groups import CpuGroups
from tessera_cli.experiments.distribution.faults import require_tools
from tessera_cli.experiments.distribution.grid import (
    KILLED,
    LOSS,
    Configuration,
    Experiment,
    check_extractors,
    fault_grid,
    latency_grid,
    read_key,
    throughput_grid,
)
from tessera_cli.experiments.distribution.lan import Lan, require_root
from tessera_cli.experiments.distribution.nodes import Nodes
from tessera_cli.experiments.distribution.outcome import CALIBRATION, Outcome, read_outcome
from tessera_cli.experiments.distribution.page import headline, write_distribution_page, write_pictures
from tessera_cli.experiments.distribution.runs import Job, StackRunner, extractor_step_ms, read_traffic
from tessera_cli.experiments.distribution.tables import as_csv, as_json, as_markdown, print_outcome
from tessera_cli.experiments.plan import (
    ExperimentFolder,
    PlannedRun,
    Sequence,
    alternate,
    check_out,
    choose_sequences,
    open_folder,
    read_complete,
)
from tessera_cli.experiments.progress_view import ProgressView
from tessera_cli.experiments.rendering import render
from tessera_cli.experiments.series import disturbances, measure_all
from tessera_cli.files import absolute, write_text
from tessera_cli.interrupt import Interrupt

STANDARD = [Sequence("KITTI 03", "mono", "kitti:kitti/sequences/03"), Sequence("street", "mono", "sim:street")]
CALIBRATION_FRAMES = 20
PICTURES = "pictures"


def measure_distribution(arguments: Namespace, experiment: Experiment) -> int:
    """`tessera experiment single|homogeneous|heterogeneous`."""
    require_root(f"experiment {experiment.name}")
    if not arguments.no_faults:
        require_tools()
    extractors = arguments.extractors or list(experiment.extractors)
    check_extractors(experiment, extractors)
    sequence = _sequence(arguments)
    check_out(arguments.out, arguments.force)
    checkout, interrupt = this_checkout(), Interrupt()
    description = _describe(arguments, experiment, sequence, checkout)
    folder, continues = open_folder(arguments.out, f"experiment-{experiment.name}", description, arguments.force)
    grids = _grids(experiment, extractors, arguments.tiles or list(experiment.cuts), not arguments.no_faults)
    with ProgressView() as view:
        commands = CommandRunner(folder.logs, interrupt)
        if not continues:
            folder.begin(description)
            (folder.path / CALIBRATION).unlink(missing_ok=True)
        source = render(sequence, arguments.frames[1], checkout, commands, view)
        series = _Series(arguments, experiment, sequence, source, folder, view)
        try:
            series.carry_out(_plan(sequence, grids, arguments.repetitions), max(extractors), checkout, commands)
        except BaseException:
            view.say(f"what is done is kept: the same command with --out {folder.path} continues it")
            raise
    return _present(folder, series.runs)


def _sequence(arguments: Namespace) -> Sequence:
    specs = [arguments.source] if arguments.source else []
    sequences, absent = choose_sequences(specs, STANDARD, absolute(arguments.data))
    if absent:
        say(absent[0])
    return sequences[0]


def _describe(arguments: Namespace, experiment: Experiment, sequence: Sequence, checkout: Checkout) -> dict[str, Any]:
    """What must be the same for runs to be put together; extractors, cuts and repetitions may be added."""
    return {
        "experiment": experiment.name,
        "sequences": [{"name": sequence.name, "sensor": sequence.sensor, "source": sequence.source}],
        "this": checkout.fingerprint(),
        "frames": list(arguments.frames),
        **({"step_ms": arguments.step_ms} if experiment.is_slow else {}),
        **({"settings": arguments.settings} if arguments.settings else {}),
    }


Grids = tuple[list[Configuration], list[Configuration], list[Configuration]]


def _grids(experiment: Experiment, extractors: list[int], cuts: list[str], with_faults: bool) -> Grids:
    """For speed, for latency, and with faults."""
    faults = fault_grid(extractors, cuts) if with_faults else []
    return throughput_grid(extractors, cuts), latency_grid(extractors, cuts), faults


def _plan(sequence: Sequence, grids: Grids, repetitions: int) -> list[PlannedRun]:
    """The first repetition comes with latencies and faults, so that an experiment tells something of all early."""
    throughput, latency, faults = ([each.key for each in grid] for grid in grids)
    first = alternate([sequence], throughput, 1) + alternate([sequence], latency + faults, 1)
    return first + [run for run in alternate([sequence], throughput, repetitions) if run.repetition > 1]


class _Series:
    """All runs of one experiment."""

    def __init__(
        self,
        arguments: Namespace,
        experiment: Experiment,
        sequence: Sequence,
        source: str,
        folder: ExperimentFolder,
        view: ProgressView,
    ) -> None:
        self._arguments, self._experiment, self._sequence, self._source = arguments, experiment, sequence, source
        self._folder, self._view = folder, view
        self.runs: list[PlannedRun] = []

    def carry_out(self, runs: list[PlannedRun], most: int, checkout: Checkout, commands: CommandRunner) -> None:
        """`most`: extractors at once."""
        self.runs = runs
        if all(self._folder.summary(run) for run in runs):
            self._view.say("all runs are there already")
            return
        with ExitStack() as stack:
            lan = stack.enter_context(Lan(self._experiment.link_rates_mbit(most)))
            groups = stack.enter_context(CpuGroups(most)) if self._experiment.is_slow else None
            self._view.say(f"{len(lan.hosts)} hosts in network namespaces; deputies are starting")
            port = self._arguments.port
            nodes = stack.enter_context(Nodes(self._folder.path / "nodes", lan, checkout, port, groups))
            stack_runner = StackRunner(self._experiment, lan, nodes, commands, port, self._arguments.settings)
            if groups:
                calibration = self._calibrate(stack_runner, groups)
                self._view.say(check_room(calibration, most, len(os.sched_getaffinity(0))))
                groups.set_share(calibration.share)
            measure_all(self._folder, runs, lambda run: self._run(stack_runner, run), self._view)

    def _run(self, stack_runner: StackRunner, run: PlannedRun) -> float:
        path, configuration = self._folder.run_path(run), _configuration(run)
        expected_bytes = 0
        if configuration.variant in (KILLED, LOSS):
            undisturbed = PlannedRun(run.sequence, Configuration(configuration.extractors, configuration.tiles).key, 1)
            host = self._experiment.num_hosts(configuration.extractors)
            expected_bytes = read_traffic(self._folder.run_path(undisturbed))[host].received
        frames = self._arguments.frames
        job = Job(run.name, path, self._sequence, self._source, frames, configuration, expected_bytes)
        return stack_runner.run(job, self._view.look)

    def _calibrate(self, stack_runner: StackRunner, groups: CpuGroups) -> Calibration:
        path = self._folder.path / CALIBRATION
        if found := read_calibration(path):
            return found
        first = self._arguments.frames[0]
        frames = (first, first + CALIBRATION_FRAMES)
        folder = self._folder.path / "calibration"
        configuration = Configuration(1, "1x1")

        def measure_ms(share: float) -> float:
            groups.set_share(share)
            self._view.begin(f"calibrating slow nodes, {100 * share:.1f} % of a core")
            job = Job("calibration", folder, self._sequence, self._source, frames, configuration)
            stack_runner.run(job, self._view.look)
            step_ms = extractor_step_ms(read_complete(folder) or {})
            self._view.say(f"with {100 * share:.1f} % of a core, a whole image takes {step_ms:.1f} ms")
            return step_ms

        calibration = calibrate(measure_ms, self._arguments.step_ms)
        write_calibration(calibration, path)
        return calibration


def _configuration(run: PlannedRun) -> Configuration:
    found = read_key(run.side)
    assert found
    return found


def _present(folder: ExperimentFolder, runs: list[PlannedRun]) -> int:
    """Prints the tables and writes the results. Returns the exit status."""
    outcome = read_outcome(folder.path)
    claims = check_claims(outcome)
    remarks = [*_room(outcome), *disturbances(folder, runs)]
    if outcome.settings:
        remarks.insert(0, f"All runs had these settings: {', '.join(outcome.settings)}.")
    name = outcome.experiment.name
    page = folder.path / f"{name}.html"
    write_text(folder.path / f"{name}.json", json.dumps(as_json(outcome, claims, remarks), indent=2) + "\n")
    write_text(folder.path / f"{name}.csv", as_csv(outcome))
    write_text(folder.path / f"{name}.md", as_markdown(outcome))
    write_pictures(folder.path / PICTURES, write_distribution_page(page, [outcome], remarks))
    print_outcome(outcome, claims)
    for sentence in [headline(claims), *remarks]:
        print(sentence)
    print(f"page: {page}, tables as {name}.json, {name}.csv and {name}.md beside it")
    is_sound = len(outcome.hashes) == 1 and not any(
        run.failures for cell in outcome.cells.values() for run in cell.runs
    )
    return 0 if is_sound else 1


def _room(outcome: Outcome) -> list[str]:
    """What the machine had left while it played so many nodes."""
    cores = len(os.sched_getaffinity(0))
    used = {cell.configuration: cell.typical.cores for cell in outcome.of_variant("")}
    if not used:
        return []
    busiest = max(used, key=lambda each: used[each])
    left = max(0.0, cores - used[busiest])
    found = [
        f"The configuration that needs most of this machine's {cores} cores, P = {busiest.extractors} with "
        f"{busiest.tiles}, used {used[busiest]:.2f} of them; {left:.2f} were left."
    ]
    if outcome.calibration:
        found.insert(0, check_room(outcome.calibration, outcome.extractors[-1], cores))
    return found


def compare_distributions(arguments: Namespace) -> int:
    """`tessera experiment compare A B`."""
    outcomes = [read_outcome(absolute(text)) for text in (arguments.first, arguments.second)]
    if outcomes[0].path == outcomes[1].path:
        raise UserError(f"{arguments.first} and {arguments.second} are the same experiment.")
    out = absolute(arguments.out) if arguments.out else Path.cwd() / "comparison.html"
    remarks = _differences(outcomes)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_distribution_page(out, outcomes, remarks)
    for outcome in outcomes:
        print(f"{outcome.name}: {outcome.experiment.summary}")
        print_outcome(outcome, check_claims(outcome))
    for sentence in remarks:
        print(sentence)
    print(f"page: {out}")
    return 0


def _differences(outcomes: list[Outcome]) -> list[str]:
    first, second = outcomes
    found = []
    if first.settings != second.settings:
        changed = [", ".join(each.settings) or "none" for each in outcomes]
        found.append(f"The settings that --set changed differ: {changed[0]} and {changed[1]}.")
    if first.sequence != second.sequence or first.num_frames != second.num_frames:
        found.append(
            f"The sequences differ: {first.sequence}, {first.num_frames} frames, and {second.sequence}, "
            f"{second.num_frames} frames; so do their results."
        )
    elif first.hashes == second.hashes:
        found.append("All runs of both have the same trajectory and map, bit for bit.")
    else:
        found.append("The two have different trajectories or maps.")
    for configuration, cell in first.cells.items():
        other = second.cells.get(configuration)
        if other and not configuration.variant:
            one, two = (each.median(lambda run: run.poses_per_s) for each in (cell, other))
            name = f"P = {configuration.extractors}, {configuration.tiles}"
            found.append(f"{name}: {one:.1f} and {two:.1f} poses per second, {two / one:.2f}x.")
    return found
