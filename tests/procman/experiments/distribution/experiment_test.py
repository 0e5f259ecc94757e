"""The command as a user gives it: it measures in namespaces of its own, and leaves none. Needs root."""

import json
import os
import signal
from pathlib import Path

import pytest

from helpers.stack import NUM_FRAMES, Finished, Tessera, read_line, wait_for
from helpers.synthetic_sequence import HEIGHT_PX, WIDTH_PX
from tessera_cli.errors import UserError
from tessera_cli.experiments.distribution.lan import SPACES, require_root
from tessera_cli.files import BIN

pytestmark = pytest.mark.skipif(
    not (BIN / "tessera-tracker").exists(), reason="the stages are not built: procman/tessera setup builds them"
)


@pytest.fixture(autouse=True)
def root() -> None:
    try:
        require_root("an experiment")
    except UserError as error:
        pytest.skip(str(error))


def spaces(pid: int) -> list[Path]:
    return list(SPACES.glob(f"tessera{pid}-*"))


def test_two_hosts_make_what_one_makes(
    tessera: Tessera, sequence: Path, reference_run: Finished, tmp_path: Path
) -> None:
    options = ("--extractors", 2, "--tiles", "2x2", "--repetitions", 1, "--no-faults", "--port", tessera.next_port())
    as_they_are = ("--set", "dispatcher.pack_tiles=false")
    finished = tessera.command(
        "experiment", "homogeneous", f"kitti:{sequence}", *options, *as_they_are, "--out", tmp_path / "out"
    ).must_end_well()
    assert "met: one trajectory and one map, bit for bit: 2 runs" in finished.out
    results = json.loads((tmp_path / "out" / "homogeneous.json").read_text())
    assert {run["variant"] for run in results["runs"]} == {"", "alone"}
    for run in results["runs"]:
        assert run["trajectory_sha256"] == reference_run.summary["trajectory_sha256"]
        assert run["link_bytes"]["node2"]["received"] > NUM_FRAMES * WIDTH_PX * HEIGHT_PX, "images as they are"
    assert "All runs had these settings: dispatcher.pack_tiles=false." in finished.out
    assert (tmp_path / "out" / "homogeneous.html").is_file() and (tmp_path / "out" / "homogeneous.csv").is_file()


def test_an_interrupted_one_leaves_no_namespace(tessera: Tessera, sequence: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = tessera.start(
        *("experiment", "homogeneous", f"kitti:{sequence}", "--extractors", 1, "--tiles", "1x1", "--no-faults"),
        *("--port", tessera.next_port(), "--out", out),
    )
    assert "2 hosts in network namespaces" in read_line(process)
    wait_for(lambda: (out / "nodes" / "node2.log").is_file(), "the second deputy")
    assert len(spaces(process.pid)) == 3
    os.kill(process.pid, signal.SIGINT)
    rest, _ = process.communicate(timeout=60)
    assert process.returncode == 1 and "what is done is kept" in rest, rest
    assert spaces(process.pid) == []
