"""A run whose disk fills up goes on without what it cannot write, keeps what is precious, and ends with status 1."""

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from helpers.stack import Finished, Tessera


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Of 12 MB, less than the recording of the sequence takes."""
    if os.geteuid() != 0:
        pytest.skip("only root can mount a file system of a few megabytes")
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=12m", "none", folder], capture_output=True, text=True)
    if mounted.returncode != 0:
        pytest.skip(f"this machine mounts no tmpfs: {mounted.stderr.strip()}")
    yield folder
    subprocess.run(["umount", folder], check=True)


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
