"""tessera experiment performance, cut short: this checkout against itself, on a simulated drive."""

import json
import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from helpers.page import Page
from helpers.stack import ROOT, RUN_TIMEOUT_S, Finished, Tessera, wait_for
from tessera_cli.supervision.process_tree import marked

FRAMES = "0:30"


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Rendered drives of the user are neither used nor changed."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("cache")
        patch.setenv("XDG_CACHE_HOME", str(folder))
        yield folder


def words(tessera: Tessera, out: Path) -> list[object]:
    options = ("--source", "stereo=sim:street-short", "--frames", FRAMES, "--repetitions", 1, "--extractors", 1)
    return ["experiment", "performance", *options, "--port", tessera.next_port(), "--out", out]


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("experiment") / "out"


@pytest.fixture(scope="module")
def first(tessera: Tessera, out: Path) -> Finished:
    # Rendering, four runs and a page: on a busy machine more than any single run may take.
    return tessera.command(*words(tessera, out), "--against", ROOT, timeout=4 * RUN_TIMEOUT_S).must_end_well()


def test_both_sides_are_measured_and_told(first: Finished, out: Path) -> None:
    (results,) = json.loads((out / "performance.json").read_text())["sequences"]
    for side in ("this", "that"):
        (run,) = results[side]
        assert run["frames"] == 30 and run["frames_per_s"] > 0 and run["error_m"] < 1
        assert run["cpu_ms"]["mapper"] > 0 and run["busy_ms"]["mapper"] > 0
    rows = {row["figure"]: row for row in results["rows"]}
    assert rows["trajectory, map"]["ratio"] == "same", "equal programs give equal results"
    assert "street-short stereo" in first.out and "frames/s" in first.out


def test_the_page_has_the_way_of_a_frame_for_each_side(first: Finished, out: Path) -> None:
    labels = [svg.attributes["aria-label"] for svg in Page(out / "performance.html").root.all("svg")]
    assert any("this, " in label and "that, " in label and "mapper" in label for label in labels), labels


def test_large_files_are_not_kept(first: Finished, out: Path) -> None:
    assert max(path.stat().st_size for path in out.rglob("*") if path.is_file()) < 5_000_000


def test_it_continues_with_what_is_missing(tessera: Tessera, first: Finished, out: Path) -> None:
    runs = out / "runs" / "street_short_stereo"
    kept = (runs / "this-1" / "summary.json").stat().st_mtime_ns
    shutil.rmtree(runs / "that-1")
    again = tessera.command(*words(tessera, out), "--against", ROOT).must_end_well()
    assert "1 of 2 runs are there already" in again.out
    assert (runs / "this-1" / "summary.json").stat().st_mtime_ns == kept
    assert (runs / "that-1" / "summary.json").is_file()


def test_another_experiment_does_not_overwrite_it(tessera: Tessera, first: Finished, out: Path) -> None:
    tessera.command(*words(tessera, out), "--frames", "0:31", "--against", ROOT).must_refuse(
        "another frames", "--force"
    )


def test_ctrl_c_leaves_nothing_running(tessera: Tessera, first: Finished, tmp_path: Path) -> None:
    out = tmp_path / "interrupted"
    experiment = tessera.start(*words(tessera, out), "--no-timeline")
    wait_for((out / "runs").is_dir, "a run")
    wait_for(lambda: list((out / "runs").rglob("mapper.log")), "its stack")
    experiment.send_signal(signal.SIGINT)
    text, _ = experiment.communicate(timeout=RUN_TIMEOUT_S)
    assert experiment.returncode == 1 and "interrupted" in text and f"--out {out}" in text, text
    left = [pid for pid in map(int, filter(str.isdecimal, os.listdir("/proc"))) if names(pid, out)]
    assert not left and not marked(f"{out / 'logs'}/")


def names(pid: int, out: Path) -> bool:
    """Whether the command line of a process names this folder."""
    try:
        return str(out).encode() in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False


@pytest.mark.parametrize(
    "arguments, word",
    [
        (["--against", "no-such-commit"], "no-such-commit"),
        (["--source", "sonar=kitti:/tmp"], "sonar"),
        (["--source", "kitti:/no/such/folder"], "/no/such/folder"),
        (["--repetitions", "0"], "--repetitions"),
        (["--out", "/proc/version"], "/proc/version"),
    ],
)
def test_arguments_at_fault(tessera: Tessera, arguments: list[str], word: str) -> None:
    tessera.command("experiment", "performance", *arguments).must_refuse(word)
