"""The table of experiment cores: what the work allows, and what was measured."""

import os
from typing import Any

import pytest

from tessera_cli.errors import UserError
from tessera_cli.experiments.cores import Work, cores_that_are_there, tabulate, work_of
from tessera_cli.experiments.plan import Sequence

SEQUENCE = Sequence("KITTI 03", "mono", "kitti:x")


def summary(frames_per_s: float, map_hash: str = "m") -> Any:
    cpu_s = {"mapper": 1.0, "tracker": 0.5, "extractor_0": 0.25, "extractor_1": 0.25}
    return {
        "frames": 100,
        "cpu_s": cpu_s,
        "keyframes": 20,
        "frames_per_s": frames_per_s,
        "trajectory_sha256": "t",
        "map_sha256": map_hash,
    }


def test_cores_bound_the_rate_until_one_process_does() -> None:
    work = work_of(summary(1.0))
    assert work == Work(20.0, "mapper", 10.0)
    assert work.bound(1) == (50.0, "cores")
    assert work.bound(2) == (100.0, "mapper")
    assert work.bound(64) == (100.0, "mapper")


def test_numbers_of_cores_that_the_machine_lacks_have_a_bound_alone() -> None:
    rows = tabulate(SEQUENCE, {1: summary(45.0), 2: summary(90.0)}, [4, 2, 1])
    assert [(row.cores, row.frames_per_s, row.is_same) for row in rows] == [
        (1, 45.0, True),
        (2, 90.0, True),
        (4, None, None),
    ]
    assert rows[2].bound_frames_per_s == 100.0


def test_another_map_on_more_cores_is_told() -> None:
    rows = tabulate(SEQUENCE, {1: summary(45.0), 2: summary(90.0, "other")}, [1, 2])
    assert [row.is_same for row in rows] == [True, False]


def test_a_machine_with_none_of_the_numbers_of_cores() -> None:
    available = len(os.sched_getaffinity(0))
    assert cores_that_are_there([1, 1, available + 1]) == [1]
    with pytest.raises(UserError, match=f"has {available} cores"):
        cores_that_are_there([available + 1])
