"""One run of the stack on the nodes of a LAN: its settings, what it sent, and what went wrong in between on purpose."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tessera_cli.constants import PORT_OFFSETS
from tessera_cli.errors import RunError
from tessera_cli.experiments.commands import CommandRunner
from tessera_cli.experiments.distribution.faults import make_fault
from tessera_cli.experiments.distribution.grid import Configuration, Experiment
from tessera_cli.experiments.distribution.lan import Lan, Traffic
from tessera_cli.experiments.distribution.nodes import LIST, LIST_NAME, Nodes, stack_list
from tessera_cli.experiments.plan import Sequence, read_complete
from tessera_cli.files import write_text
from tessera_cli.lcm_bus import bus_url
from tessera_cli.runs.run_folder import Summary

TRAFFIC = "traffic.json"


@dataclass(frozen=True)
class Job:
    """What one run does."""

    name: str  # of its log
    path: Path  # of its folder
    sequence: Sequence
    source: str  # that stands for the sequence
    frames: tuple[int, int]  # last exclusive; -1: to the end
    configuration: Configuration
    expected_bytes: int = 0  # that the last host receives, if something is to go wrong


class StackRunner:
    """Runs the stack on a LAN whose deputies run."""

    def __init__(
        self,
        experiment: Experiment,
        lan: Lan,
        nodes: Nodes,
        commands: CommandRunner,
        port: int,
        settings: list[str],
    ) -> None:
        """`settings`: section.key=value, for all runs; what a configuration sets itself wins."""
        self._experiment, self._lan, self._nodes, self._commands = experiment, lan, nodes, commands
        self._port, self._settings = port, settings

    def run(self, job: Job, look: Callable[[str], None]) -> float:
        """CPU seconds of all that was started. The run's folder gets TRAFFIC too. Raises RunError if it fails."""
        job.path.mkdir(parents=True, exist_ok=True)
        (job.path / "summary.json").unlink(missing_ok=True)
        path = job.path / "stack.pmd"
        write_text(path, stack_list(LIST.read_text(), self._experiment, job.configuration.extractors))
        words = self._nodes.words("up", path, "--name", LIST_NAME, "--script", "run", "--out", job.path)
        for assignment in self._assignments(job):
            words += ["--set", assignment]
        fault = make_fault(job.configuration, self._experiment, self._lan, self._nodes, job.expected_bytes)

        def look_at_both(line: str) -> None:
            fault.look()
            look(line)

        before, deputies_s = self._traffic(), self._nodes.cpu_s()
        try:
            cpu_s = self._commands.run(job.name, words, job.path, self._nodes.environment, look_at_both, job.path)
        finally:
            fault.end()
        traffic = {host: after - before[host] for host, after in self._traffic().items()}
        write_traffic(job.path, traffic)
        summary = read_complete(job.path)
        if summary is None:
            raise RunError(f"{job.name} left no summary; {job.path / 'stages'} may say why.")
        # A deputy that was killed in between takes its count with it.
        return cpu_s + sum(summary["cpu_s"].values()) + max(0.0, self._nodes.cpu_s() - deputies_s)

    def _assignments(self, job: Job) -> list[str]:
        configuration, (first, last) = job.configuration, job.frames
        return [
            *self._settings,
            f"camera.source={job.source}",
            f"camera.sensor={job.sequence.sensor}",
            f"camera.first_frame={first}",
            f"camera.last_frame={last}",
            f"camera.lockstep_window={configuration.window}",
            f"dispatcher.max_frames_in_flight={configuration.window}",
            f"dispatcher.tiles={configuration.tiles}",
            # Camera and dispatcher are on the first host: its link carries tiles, not images.
            f"bus.camera_url={bus_url(self._port + PORT_OFFSETS['camera'])}",
        ]

    def _traffic(self) -> dict[int, Traffic]:
        return {host: self._lan.traffic(host) for host in self._lan.hosts}


def write_traffic(folder: Path, traffic: dict[int, Traffic]) -> None:
    links = {f"node{host}": {"sent": each.sent, "received": each.received} for host, each in traffic.items()}
    write_text(folder / TRAFFIC, json.dumps(links, indent=2) + "\n")


def read_traffic(folder: Path) -> dict[int, Traffic]:
    """By host; empty if the run did not come to its end."""
    try:
        links = json.loads((folder / TRAFFIC).read_text())
    except (OSError, ValueError):
        return {}
    return {int(name.removeprefix("node")): Traffic(**each) for name, each in links.items()}


def extractor_step_ms(summary: Summary) -> float:
    """Median time in which an extractor does one job, mean of all extractors."""
    steps = [each["median"] for name, each in summary["stage_ms"].items() if name.startswith("extractor")]
    return sum(steps) / len(steps)
