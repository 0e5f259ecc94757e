"""Stages that stop working for a while are told to the user, not those in a long step. Poses count once."""

import signal
import subprocess
import time
from typing import Any

import pytest

from helpers.recorded_log import message_of
from helpers.stack import wait_for
from tessera_cli.supervision.progress import FINISHED, RUNNING, Progress, StageReport
from tessera_cli.supervision.silence import SilenceWatch, is_stopped


def report(received_at: float, state: int = RUNNING, pid: int = 1) -> StageReport:
    values: dict[str, Any] = dict.fromkeys(StageReport.__dataclass_fields__, 0)
    return StageReport(**{**values, "name": "tracker", "pid": pid, "state": state, "received_at": received_at})


def test_a_silent_stage_is_told_once_and_its_return_too() -> None:
    watch = SilenceWatch(lambda _name: False)
    assert watch.step([report(10.0)], 12.9) == []
    assert watch.step([report(10.0)], 13.1) == ["tracker has said nothing for 3 s and does not work either"]
    assert watch.step([report(10.0)], 14.0) == [] and watch.warnings == []
    assert watch.step([report(15.2)], 15.3) == ["tracker is back after 5.2 s"]
    assert watch.warnings == ["tracker said nothing for 5.2 s."]
    assert watch.step([report(15.2)], 15.4) == []


def test_a_long_step_and_the_end_are_no_silence() -> None:
    is_busy = True
    watch = SilenceWatch(lambda _name: is_busy)
    assert [watch.step([report(10.0)], now) for now in range(11, 60)] == [[]] * 49
    is_busy = False
    assert watch.step([report(10.0)], 61.0) == [], "it was busy until a moment ago"
    assert len(watch.step([report(10.0)], 62.5)) == 1
    assert SilenceWatch(lambda _name: False).step([report(10.0, FINISHED)], 90.0) == []


def test_a_stopped_process_is_known_though_it_used_the_processor() -> None:
    process = subprocess.Popen(["sleep", "100"])
    try:
        assert not is_stopped(process.pid)
        process.send_signal(signal.SIGSTOP)
        wait_for(lambda: is_stopped(process.pid), "its stop")
        now = time.monotonic()
        told = SilenceWatch(lambda _name: True).step([report(now - 4, pid=process.pid)], now)
        assert told == ["tracker has said nothing for 4 s and is stopped (SIGCONT lets it go on)"]
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("frames", [list(range(120)), [*range(75), *range(120)]])
def test_poses_of_a_tracker_that_was_started_again_count_once(frames: list[int]) -> None:
    progress = Progress(num_frames=120)
    for frame in frames:
        progress.add_pose(message_of("pose_t", frame=frame))
    assert progress.num_poses == 120 and progress.last_frame == 119
