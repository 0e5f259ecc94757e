"""Faults that hit processes of a run: thrown while poses come, and ended with the experiment."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from helpers.stack import FIRST_PORT
from tessera_cli.experiments.faults.schedule import KILL, STOP, Fault
from tessera_cli.experiments.faults.thrower import Thrower
from tessera_cli.lcm_bus import Bus, bus_url
from tessera_cli.messages import pose_t
from tessera_cli.supervision.process_tree import MARK
from tessera_cli.supervision.silence import is_stopped

URL = bus_url(FIRST_PORT + 30)


@pytest.fixture
def mapper(tmp_path: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A process with the mark of a run's mapper."""
    environment = {**os.environ, MARK: f"{tmp_path}/stages/mapper"}
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"], env=environment)
    yield process
    process.kill()
    process.wait()


class Tracker:
    """Sends a pose whenever the thrower looks."""

    def __init__(self) -> None:
        self._bus = Bus(URL, "tracker")
        self._frame = 0

    def track(self, thrower: Thrower) -> None:
        pose = pose_t()
        pose.header, pose.frame, pose.state = self._bus.header("POSE"), self._frame, pose_t.TRACKED
        self._frame += 1
        self._bus.publish("POSE", pose.encode())
        thrower.look()


def thrower_of(folder: Path, faults: list[Fault], most: int = 10) -> Thrower:
    return Thrower(folder, URL, iter(faults), most, time.monotonic() + 60, None)


def test_a_process_is_stopped_for_a_while_and_then_killed(tmp_path: Path, mapper: subprocess.Popen[bytes]) -> None:
    faults = [Fault("mapper", STOP, 0.0, 0.2), Fault("mapper", KILL, 0.1, 0.0), Fault("mapper", STOP, 60.0, 1.0)]
    tracker, was_stopped, deadline = Tracker(), False, time.monotonic() + 10
    with thrower_of(tmp_path, faults) as thrower:
        while mapper.poll() is None:
            assert time.monotonic() < deadline
            tracker.track(thrower)
            was_stopped = was_stopped or is_stopped(mapper.pid)
    assert was_stopped and mapper.returncode == -signal.SIGKILL
    stop, kill = thrower.thrown
    assert (stop.process, stop.kind, kill.kind) == ("mapper", STOP, KILL)
    assert stop.ended_s - stop.began_s >= 0.2 and kill.began_s > stop.ended_s and kill.ended_s == kill.began_s
    assert 0 <= stop.frame < kill.frame and len(thrower.pose_times) > kill.frame


def test_nothing_stays_stopped_when_the_run_is_over(tmp_path: Path, mapper: subprocess.Popen[bytes]) -> None:
    tracker, deadline = Tracker(), time.monotonic() + 10
    with thrower_of(tmp_path, [Fault("mapper", STOP, 0.0, 60.0)]) as thrower:
        while not is_stopped(mapper.pid):
            assert time.monotonic() < deadline
            tracker.track(thrower)
    assert not is_stopped(mapper.pid)


def test_nothing_is_thrown_without_poses_or_beyond_the_number(tmp_path: Path, mapper: subprocess.Popen[bytes]) -> None:
    faults = [Fault("mapper", KILL, 0.0, 0.0)]
    with thrower_of(tmp_path, faults) as thrower:
        thrower.look()
    with thrower_of(tmp_path, faults, most=0) as none_wanted:
        tracker = Tracker()
        for _ in range(5):
            tracker.track(none_wanted)
    assert not thrower.thrown and not none_wanted.thrown and mapper.poll() is None
