"""Two robots share four extractors: each has the same trajectory and map as alone, whatever else happens."""

import json
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from helpers.stack import FIRST_PORT, NUM_FRAMES, ROOT, RUN_TIMEOUT_S, Finished, Tessera
from tessera_cli import settings
from tessera_cli.cluster.keys import key_folder
from tessera_cli.files import BIN
from tessera_cli.membership import pool_secret
from tessera_cli.supervision.progress import RUNNING
from tessera_cli.supervision.stack_monitor import StackMonitor

DATA = Path(os.environ.get("TESSERA_DATA", ROOT.parent / "shared" / "data"))
KITTI_03 = DATA / "kitti" / "sequences" / "03"
NUM_KITTI_FRAMES = 150
STAGES = ("evaluator", "mapper", "loop_closer", "global_adjuster", "tracker", "reassembler", "dispatcher")
NUM_EXTRACTORS = 4
PORT = FIRST_PORT


class Processes:
    """Stages with common settings."""

    def __init__(self, folder: Path, assignments: list[str]) -> None:
        folder.mkdir()
        self.folder = folder
        values = settings.write_settings(
            settings.network_assignments(PORT, on_lan=False) + assignments, folder / "settings.yaml"
        )
        self._running: dict[str, subprocess.Popen] = {}
        pids = self._running
        self._bus = StackMonitor(
            values["bus"]["main_url"],
            values["bus"]["channel_prefix"],
            lambda pid: any(process.pid == pid for process in pids.values()),
        )

    def start(self, stage: str, number: int | None = None) -> None:
        name = stage if number is None else f"{stage}_{number}"
        with open(self.folder / f"{name}.log", "ab") as log:
            self._running[name] = subprocess.Popen(
                [
                    BIN / f"tessera-{stage.replace('_', '-')}",
                    "--settings",
                    self.folder / "settings.yaml",
                    "--name",
                    name,
                    "--id",
                    str(number or 0),
                ],
                stdout=log,
                stderr=log,
                stdin=subprocess.DEVNULL,
            )

    def wait_until_running(self) -> None:
        stages = self._bus.progress.stages
        self.listen_until(
            lambda: all(name in stages and stages[name].state >= RUNNING for name in self._running), "the stages"
        )

    def listen_until(self, condition: Callable[[], object], what: str) -> None:
        deadline = time.monotonic() + RUN_TIMEOUT_S
        while not condition():
            assert time.monotonic() < deadline, f"waited in vain for {what} in {self.folder}"
            self._bus.listen(0.02)

    @property
    def num_poses(self) -> int:
        return self._bus.progress.num_poses

    @property
    def values(self) -> dict[str, dict[str, float]]:
        """What each stage counts besides."""
        self._bus.listen(0.001)
        return {name: report.values for name, report in self._bus.progress.stages.items()}

    def kill(self, *names: str) -> None:
        for name in names or list(self._running):
            process = self._running.pop(name)
            process.kill()
            process.wait()

    def stop(self) -> None:
        for process in self._running.values():
            process.send_signal(signal.SIGTERM)
        for process in self._running.values():
            process.wait(20)
        self._running.clear()


class Robot(Processes):
    """The processes of one robot but for extractors."""

    def __init__(self, folder: Path, prefix: str, *assignments: str) -> None:
        super().__init__(folder, [f"bus.channel_prefix={prefix}", f"evaluator.out_dir={folder}", *assignments])

    def start_all(self, num_extractors: int = 0) -> "Robot":
        for stage in STAGES:
            self.start(stage)
        for number in range(num_extractors):
            self.start("extractor", number)
        self.wait_until_running()
        self.start("camera")
        return self

    def result(self) -> dict:
        """What it came to; its processes have ended."""
        self.listen_until((self.folder / "run.json").exists, "the end of the run")
        self.stop()
        facts = json.loads((self.folder / "run.json").read_text())
        return {key: facts[key] for key in ("frames", "trajectory_sha256", "map_sha256")}


class Pool(Processes):
    def __init__(self, folder: Path, *assignments: str) -> None:
        super().__init__(folder, ["extractor.robots=a_,b_", *assignments])
        for number in range(NUM_EXTRACTORS):
            self.start("extractor", number)
        self.wait_until_running()


@pytest.fixture(scope="module")
def tasks(sequence: Path) -> dict[str, list[str]]:
    """What the two robots do: one image cut into small tiles, and whole stereo images."""
    if KITTI_03.is_dir():
        source = [f"camera.source=kitti:{KITTI_03}", f"camera.last_frame={NUM_KITTI_FRAMES}"]
    else:
        source = [f"camera.source=kitti:{sequence}"]
    return {"a_": [*source, "dispatcher.tiles=2x2"], "b_": [f"camera.source=kitti:{sequence}", "camera.sensor=stereo"]}


@pytest.fixture(scope="module")
def alone(tasks: dict[str, list[str]], tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict]:
    """What each robot comes to with one extractor of its own."""
    folder = tmp_path_factory.mktemp("alone")
    return {
        prefix: Robot(folder / prefix, prefix, *task).start_all(num_extractors=1).result()
        for prefix, task in tasks.items()
    }


class Starter:
    """Starts pools and robots."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._started: list[Processes] = []

    def pool(self, *assignments: str) -> Pool:
        pool = Pool(self._folder / "pool", *assignments)
        self._started.append(pool)
        return pool

    def robot(self, name: str, prefix: str, *task: str) -> Robot:
        robot = Robot(self._folder / name, prefix, *task)
        self._started.append(robot)
        return robot

    def kill_all(self) -> None:
        for processes in self._started:
            processes.kill()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Starter]:
    starter = Starter(tmp_path)
    yield starter
    starter.kill_all()


def test_two_robots_share_four_extractors(
    start: Starter, tasks: dict[str, list[str]], alone: dict[str, dict[str, Any]]
) -> None:
    pool = start.pool()
    robots = {prefix: start.robot(prefix, prefix, *task).start_all() for prefix, task in tasks.items()}
    assert {prefix: robot.result() for prefix, robot in robots.items()} == alone
    for values in pool.values.values():
        assert values["work_a_"] > 0 and values["work_b_"] > 0


def test_a_shared_extractor_that_is_killed_changes_nothing(
    start: Starter, tasks: dict[str, list[str]], alone: dict[str, dict[str, Any]]
) -> None:
    pool = start.pool()
    robots = {prefix: start.robot(prefix, prefix, *task).start_all() for prefix, task in tasks.items()}
    robots["a_"].listen_until(lambda: robots["a_"].num_poses > NUM_FRAMES // 4, "poses")
    pool.kill("extractor_1", "extractor_3")
    pool.start("extractor", 3)
    assert {prefix: robot.result() for prefix, robot in robots.items()} == alone


def test_robots_come_and_go_and_come_again(
    start: Starter, tasks: dict[str, list[str]], alone: dict[str, dict[str, Any]]
) -> None:
    start.pool()
    a = start.robot("a", "a_", *tasks["a_"]).start_all()
    a.listen_until(lambda: a.num_poses > NUM_FRAMES // 4, "poses")
    b = start.robot("b, killed", "b_", *tasks["b_"]).start_all()
    b.listen_until(lambda: b.num_poses > NUM_FRAMES // 4, "poses")
    b.kill()
    time.sleep(1.0)  # who was killed counts as there for so long
    again = start.robot("b, again", "b_", *tasks["b_"]).start_all()
    assert a.result() == alone["a_"]
    assert again.result() == alone["b_"]
    once_more = start.robot("a, once more", "a_", *tasks["a_"]).start_all()
    assert once_more.result() == alone["a_"]


def test_tessera_run_takes_the_extractors_of_a_pool(
    start: Starter, tessera: Tessera, sequence: Path, reference_run: Finished
) -> None:
    """The extractors know the secret that all runs of this user with shared extractors have."""
    pool_secret(key_folder())
    start.pool(f"bus.run_dir={key_folder() / 'runs' / 'pool'}")
    out = tessera.next_folder().with_name("with a pool")
    tessera.command(
        "run", f"kitti:{sequence}", "--extractors", 0, "--prefix", "a_", "--port", PORT, "--out", out
    ).must_end_well()
    summary = json.loads((out / "summary.json").read_text())
    for key in ("frames", "frames_dropped", "trajectory_sha256", "map_sha256"):
        assert summary[key] == reference_run.summary[key], key
