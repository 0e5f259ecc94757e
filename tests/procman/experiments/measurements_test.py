"""Figures of runs, their medians, and what limits the speed."""

from typing import Any

import pytest

from helpers.comparisons import make_measurement
from tessera_cli.experiments.measurements import Spread, find_limit, is_repeatable, largest_part, measure, spread

SUMMARY: dict[str, Any] = {
    "frames": 100,
    "frames_per_s": 50.0,
    "keyframes": 20,
    "cpu_s": {"camera": 0.5, "extractor_0": 1.0, "extractor_1": 1.5, "mapper": 2.0},
    "stage_ms": {"mapper": {"count": 25, "mean": 60.0}, "tracker": {"count": 100, "mean": 4.0}},
    "latency_ms": {"median": 40.0, "p95": 80.0},
    "map_wait_ms": {"mean": 3.0},
    "rms_error_m": 0.5,
    "trajectory_sha256": "ab",
    "map_sha256": "cd",
}


def test_cpu_time_is_told_per_frame_with_all_extractors_as_one() -> None:
    run = measure(SUMMARY)
    assert run.cpu_ms == {"camera": 5.0, "extractors": 25.0, "mapper": 20.0}
    assert run.all_cpu_ms == 50.0


def test_busy_time_is_that_of_all_steps() -> None:
    assert measure(SUMMARY).busy_ms == {"mapper": 15.0, "tracker": 4.0}


def test_the_rest_is_taken_as_it_is() -> None:
    run = measure(SUMMARY)
    assert (run.frames_per_s, run.keyframes, run.error_m) == (50.0, 20, 0.5)
    assert (run.latency_median_ms, run.latency_p95_ms, run.map_wait_ms) == (40.0, 80.0, 3.0)
    assert run.hashes == ("ab", "cd")


def test_an_older_commit_may_have_measured_less() -> None:
    """It did not count the steps; a source may have no truth, and a run no pose that has a latency."""
    steps = {"mapper": {"mean": 60.0}}
    run = measure({**SUMMARY, "stage_ms": steps, "rms_error_m": None, "latency_ms": None, "map_wait_ms": None})
    assert run.busy_ms == {} and run.error_m is None and run.latency_p95_ms is None and run.map_wait_ms is None


def test_spread_over_repetitions() -> None:
    assert spread([3.0, 1.0, 2.0]) == Spread(2.0, 1.0, 3.0)
    assert spread([4.0, 1.0, 2.0, 3.0]) == Spread(2.5, 1.0, 4.0)
    assert spread([]) is None
    assert spread([1.0, None]) is None, "a median of some of the runs would not be comparable"


def test_runs_are_repeatable_if_trajectory_and_map_are_equal() -> None:
    run = make_measurement()
    assert is_repeatable([]) and is_repeatable([run, run])
    assert not is_repeatable([run, make_measurement(hashes=("ab" * 32, "00" * 32))])


@pytest.mark.parametrize(
    "changes, cores, limit",
    [
        # 50 frames/s are 20 ms a frame, in which two cores have 40 ms.
        ({"busy_ms": {"mapper": 18.0, "tracker": 5.0}, "cpu_ms": {"mapper": 30.0}}, 2, "mapper 90 %, cores 75 %"),
        ({"busy_ms": {"mapper": 19.0}, "cpu_ms": {"mapper": 39.0}}, 2, "cores 98 %, mapper 95 %"),
        ({"busy_ms": {}, "cpu_ms": {"mapper": 10.0}}, 1, "core 50 %"),
        ({"busy_ms": {"mapper": 5.0, "camera": 5.0}, "cpu_ms": {"mapper": 4.0}}, 4, "mapper 25 %, cores 5 %"),
    ],
)
def test_the_limit_is_the_busiest_process_or_all_cores(changes: dict[str, Any], cores: int, limit: str) -> None:
    assert find_limit(make_measurement(frames_per_s=50.0, **changes), cores) == limit


def test_largest_part() -> None:
    assert largest_part({"mapper": 3.0, "tracker": 1.0}) == "mapper 75 %"
