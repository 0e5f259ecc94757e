"""A run whose disk fills up goes on without what it cannot write, keeps what is precious, and ends with status 1."""

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from helpers.stack import Finished, Tessera


@pytest.fixture
def small_disk(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Path]:
    """Of as many megabytes as the test says."""
    if os.geteuid() != 0:
        pytest.skip("only root can mount a file system of a few megabytes")
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={request.param}m", "none", folder], capture_output=True, text=True
    )
    if mounted.returncode != 0:
        pytest.skip(f"this machine mounts no tmpfs: {mounted.stderr.strip()}")
    yield folder
    subprocess.run(["umount", folder], check=True)


# Less than the recording of the sequence takes.
@pytest.mark.parametrize("small_disk", [12], indirect=True)
def test_a_full_disk_costs_no_trajectory(
    tessera: Tessera, sequence: Path, small_disk: Path, reference_run: Finished
) -> None:
    out = small_disk / "run"
    options = ("--extractors", 1, "--record", "--port", tessera.next_port(), "--out", out)
    finished = tessera.command("run", f"kitti:{sequence}", *options)
    assert finished.status == 1, finished.out + finished.err
    assert finished.err == ""
    assert "warning: the recording is not whole: log" in finished.out
    assert "60 frames in" in finished.out
    assert not (out / "run.lcmlog").exists()
    assert (out / "trajectory.txt").read_text() == (reference_run.folder / "trajectory.txt").read_text()
    finished.folder = out
    assert finished.summary["ended"] == "complete"
    assert any("recording" in sentence for sentence in finished.summary["not_written"])


# Less than the journals of its processes take.
@pytest.mark.parametrize("small_disk", [2], indirect=True)
def test_journals_leave_room_for_the_results(
    tessera: Tessera, sequence: Path, small_disk: Path, reference_run: Finished
) -> None:
    out = small_disk / "run"
    options = ("--extractors", 1, "--port", tessera.next_port(), "--out", out)
    finished = tessera.command("run", f"kitti:{sequence}", *options)
    assert finished.err == ""
    logs = "".join(log.read_text() for log in (out / "stages").glob("*.log"))
    assert "is given up (the disk is nearly full)" in logs
    assert (out / "trajectory.txt").read_text() == (reference_run.folder / "trajectory.txt").read_text()
    finished.folder = out
    assert finished.summary["ended"] == "complete"
    for name in ("keyframes.txt", "frames.csv", "settings.yaml"):
        assert (out / name).stat().st_size > 0
