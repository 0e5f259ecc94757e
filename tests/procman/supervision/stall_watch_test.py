"""A run that is stuck ends; one whose frames wait for something that gets on does not."""

from typing import Any

import pytest

from tessera_cli.constants import ADJUSTMENT_TIMEOUT_S, STALL_TIMEOUT_S
from tessera_cli.supervision.progress import RUNNING, Progress, StageReport
from tessera_cli.supervision.stall_watch import StallWatch

BEGAN = 1000.0


def progress_of(last_pose_at: float = BEGAN, **replayed: float) -> Progress:
    """`replayed`: the share of its journal that a stage has been through."""
    progress = Progress(started_at=BEGAN, last_pose_at=last_pose_at)
    for name, share in replayed.items():
        values: dict[str, Any] = dict.fromkeys(StageReport.__dataclass_fields__, 0)
        own = {"name": name, "state": RUNNING, "values": {"journal_replayed": share}}
        progress.add_report(StageReport(**{**values, **own}))
    return progress


def test_without_a_pose_a_run_is_stuck_after_two_minutes() -> None:
    watch = StallWatch()
    assert watch.stuck_s(progress_of(), False, BEGAN + STALL_TIMEOUT_S - 1) is None
    assert watch.stuck_s(progress_of(), False, BEGAN + STALL_TIMEOUT_S + 1) == STALL_TIMEOUT_S + 1
    assert watch.stuck_s(progress_of(last_pose_at=BEGAN + 100), False, BEGAN + STALL_TIMEOUT_S + 1) is None


def test_an_adjustment_is_waited_for_but_not_for_ever() -> None:
    watch = StallWatch()
    for waited in range(0, int(ADJUSTMENT_TIMEOUT_S), 10):
        assert watch.stuck_s(progress_of(), True, BEGAN + waited) is None
    assert watch.stuck_s(progress_of(), True, BEGAN + ADJUSTMENT_TIMEOUT_S + 1) is not None


def test_a_stage_that_does_its_work_again_is_waited_for_as_long_as_it_gets_on() -> None:
    watch = StallWatch()
    hours, ends = 3, 0.0
    for minute in range(hours * 60):
        ends = BEGAN + 60.0 * minute
        assert watch.stuck_s(progress_of(mapper=minute / (hours * 60)), True, ends) is None
    assert watch.stuck_s(progress_of(mapper=1.0), False, ends + 60) is None, "its answer is on its way"
    assert watch.stuck_s(progress_of(mapper=1.0), False, ends + 60 + STALL_TIMEOUT_S) is not None


def test_one_that_does_not_get_on_is_not_waited_for() -> None:
    watch = StallWatch()
    assert watch.stuck_s(progress_of(mapper=0.4), False, BEGAN + 10) is None
    assert watch.stuck_s(progress_of(mapper=0.4), False, BEGAN + 9 + STALL_TIMEOUT_S) is None
    assert watch.stuck_s(progress_of(mapper=0.4), False, BEGAN + 11 + STALL_TIMEOUT_S) is not None


@pytest.mark.parametrize(
    ("replayed", "state"),
    [
        ({"mapper": 0.4, "tracker": 1.0}, "mapper was started again and has done 40% of its work again"),
        ({"mapper": 0.9, "tracker": 0.25}, "tracker was started again and has done 25% of its work again"),
        ({"mapper": 1.0}, "tracked"),
    ],
)
def test_the_panel_says_what_is_waited_for(replayed: dict[str, float], state: str) -> None:
    progress = progress_of(**replayed)
    progress.tracking_state = "tracked"
    assert progress.state == state
