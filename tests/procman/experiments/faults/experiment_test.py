"""The command as a user gives it: short runs during which processes are killed, and how it is continued."""

import json
from pathlib import Path

import pytest

from helpers.stack import Tessera
from tessera_cli.files import BIN

pytestmark = pytest.mark.skipif(
    not (BIN / "tessera-tracker").exists(), reason="the stages are not built: procman/tessera setup builds them"
)


def test_runs_with_killed_processes_end_like_the_undisturbed_one(
    tessera: Tessera, sequence: Path, tmp_path: Path
) -> None:
    out = tmp_path / "faults"
    words: list[object] = [
        "experiment",
        "faults",
        f"kitti:{sequence}",
        "--kinds",
        "kill",
        "--processes",
        "mapper",
        "--faults",
        1,
    ]
    # At its own rate: as fast as it goes, it would be over before the fault.
    words += ["--set", "camera.pace=realtime", "--extractors", 1, "--out", out, "--port", tessera.next_port()]
    finished = tessera.command(*words).must_end_well()
    assert "1 of 1 runs with 1 faults ended with the undisturbed trajectory and map" in finished.out
    results = json.loads((out / "faults.json").read_text())
    assert results["runs"][0]["hashes"] == results["undisturbed"]["hashes"]
    assert (out / "faults.html").is_file() and (out / "faults.csv").is_file()
    again = tessera.command(*words).must_end_well()
    assert "disturbed 1:" not in again.out and "1 of 1 runs" in again.out


def test_kinds_that_hit_no_process_are_refused(tessera: Tessera, sequence: Path) -> None:
    words = ["experiment", "faults", f"kitti:{sequence}", "--kinds", "slow", "--processes", "mapper"]
    tessera.command(*words).must_refuse("leave no fault")
