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
from tessera_cli.experiments.faults.thrower import IN_FLIGHT, IS_BACK, Thrower
from tessera_cli.lcm_bus import Bus, bus_url
from tessera_cli.messages import pose_t
from tessera_cli.runs.run_folder import SETTINGS_FILE
from tessera_cli.supervision.process_tree import MARK
from tessera_cli.supervision.silence import is_stopped

URL = bus_url(FIRST_PORT + 30)


@pytest.fixture(params=["mapper"])
def mapper(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[subprocess.Popen[bytes]]:
    """A process with the mark of a run's mapper, or of another process."""
    environment = {**os.environ, MARK: f"{tmp_path}/stages/{request.param}"}
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
    assert stop.ended_s - stop.began_s >= 0.2 and kill.began_s > stop.ended_s
    assert 0 <= stop.frame < kill.frame and len(thrower.pose_times) > kill.frame


def test_the_next_fault_waits_until_what_was_killed_is_back(tmp_path: Path, mapper: subprocess.Popen[bytes]) -> None:
    log = tmp_path / "stages" / "mapper.log"
    log.parent.mkdir()
    log.write_text(f"mapper info: {IS_BACK}\n")  # of an earlier life
    (tmp_path / "mapper.journal").touch()
    (tmp_path / SETTINGS_FILE).write_text(f"stream: {{journal_dir: '{tmp_path}'}}\n")
    tracker = Tracker()
    with thrower_of(tmp_path, [Fault("mapper", KILL, 0.0, 0.0), Fault("mapper", STOP, 60.0, 1.0)]) as thrower:
        for _ in range(20):
            tracker.track(thrower)
        assert mapper.wait() == -signal.SIGKILL and [fault.kind for fault in thrower.thrown] == [KILL]
        with log.open("a") as file:
            file.write(f"mapper info: {IS_BACK}\n")
        deadline = time.monotonic() + 10
        while thrower.thrown[0].ended_s == thrower.thrown[0].began_s:
            assert time.monotonic() < deadline
            tracker.track(thrower)


@pytest.mark.parametrize("mapper", ["camera"], indirect=True)
def test_one_without_a_journal_is_back_with_a_frame_that_was_not_on_its_way(
    tmp_path: Path, mapper: subprocess.Popen[bytes]
) -> None:
    tracker = Tracker()
    with thrower_of(tmp_path, [Fault("camera", KILL, 0.0, 0.0), Fault("camera", STOP, 60.0, 1.0)]) as thrower:
        while not thrower.thrown:
            tracker.track(thrower)
        kill = thrower.thrown[0]
        while len(thrower.pose_times) <= kill.frame + IN_FLIGHT:
            assert kill.ended_s == kill.began_s
            tracker.track(thrower)
    assert mapper.wait() == -signal.SIGKILL and kill.ended_s > kill.began_s


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
