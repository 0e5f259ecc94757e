"""The table of experiment latency, and its other program."""

import json
import os
from pathlib import Path

import psutil

from tessera_cli.experiments.latency import HEADING, Condition, _load, _row
from tessera_cli.experiments.plan import Sequence


def test_a_row_tells_latency_in_frame_intervals_of_the_rate(tmp_path: Path) -> None:
    summary = {"latency_ms": {"median": 12.2, "p99": 50.0}, "frames_dropped": 3, "frames_lost": 0}
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    # Frame 2 was dropped.
    (tmp_path / "frames.csv").write_text("frame,utime_us\n0,0\n1,100000\n3,300000\n")
    sequence = Sequence("KITTI 03", "mono", "kitti:x", None)
    row = _row(Condition(sequence, True, 2, 1, "1x1"), tmp_path)
    cells = [cell.strip() for cell in row.strip("| ").split("|")]
    assert cells[1:] == ["on every core", "20 Hz", "1", "1x1", "12", "50", "1.0", "3", "0"]
    assert row.count("|") == HEADING.count("|")


def test_the_other_program_ends_with_the_run() -> None:
    def number() -> int:
        return len(psutil.Process().children())

    before = number()
    with _load(is_busy=True):
        assert number() == before + (os.cpu_count() or 1)
    assert number() == before
    with _load(is_busy=False):
        assert number() == before
