"""Slow nodes: what share of a core makes one as slow as asked for, and whether the machine has room for all."""

from pathlib import Path

import pytest

from tessera_cli.errors import UserError
from tessera_cli.experiments.distribution.calibration import (
    TOLERANCE,
    Calibration,
    calibrate,
    check_room,
    read_calibration,
    write_calibration,
)


def test_a_node_is_as_slow_as_asked_for() -> None:
    def measure_ms(share: float) -> float:
        return 10.0 / share + (0.0 if share == 1.0 else 15.0)  # something that the share alone does not explain

    found = calibrate(measure_ms, 200.0)
    assert abs(found.step_ms / 200.0 - 1) <= TOLERANCE
    assert measure_ms(found.share) == found.step_ms
    assert found.full_step_ms == 10.0


def test_the_best_attempt_counts_where_measurements_vary() -> None:
    times = iter([10.0, 400.0, 230.0, 300.0, 100.0])
    assert calibrate(lambda _share: next(times), 200.0).step_ms == 230.0


def test_no_node_is_faster_than_a_whole_core() -> None:
    with pytest.raises(UserError, match=r"--step-ms 20.*ask for more"):
        calibrate(lambda _share: 30.0, 20.0)


def test_quotas_must_leave_something_of_the_machine() -> None:
    calibration = Calibration(share=0.1, full_step_ms=20.0, step_ms=200.0)
    assert "16 of them may use 1.60 of 2 cores; 0.40 are left" in check_room(calibration, 16, 2)
    with pytest.raises(UserError, match=r"need 2.00 cores.*--step-ms"):
        check_room(calibration, 20, 2)


def test_it_is_measured_once_for_an_experiment(tmp_path: Path) -> None:
    assert read_calibration(tmp_path / "calibration.json") is None
    calibration = Calibration(0.1, 20.0, 200.0)
    write_calibration(calibration, tmp_path / "calibration.json")
    assert read_calibration(tmp_path / "calibration.json") == calibration
