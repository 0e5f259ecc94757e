"""tessera demo, cut short: a drive is rendered once, the stack runs on it, and the result is told."""

import signal
import time
from pathlib import Path
from typing import Any

import pytest

from helpers.stack import ROOT, RUN_TIMEOUT_S, Finished, Tessera
from tessera_cli.cli.commands.demo import NUM_FRAMES as DEMO_FRAMES
from tessera_cli.cli.commands.demo import log_name
from tessera_cli.simulator import RENDERED_BY

FRAMES = 60


def logs_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.is_file())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("demo")
    # What an older simulator rendered, and what is none of the demo's business.
    (folder / "demo-street-short-stereo-60-0123456789ab.lcmlog").write_bytes(b"old")
    (folder / "mine.lcmlog").write_bytes(b"mine")
    return folder


@pytest.fixture(scope="module")
def first(tessera: Tessera, folder: Path) -> Finished:
    return tessera.command("demo", "--frames", FRAMES, "--logs", folder, "--port", tessera.next_port()).must_end_well()


def test_the_result_is_told(first: Finished, folder: Path) -> None:
    assert f"All {FRAMES} frames were tracked." in first.out and "(RMS)" in first.out
    named = {
        line.split(":")[0]: line.split()[1]
        for line in first.out.splitlines()
        if line.startswith(("picture:", "report:"))
    }
    assert Path(named["picture"]).read_bytes().startswith(b"\x89PNG")
    assert "<!DOCTYPE html>" in Path(named["report"]).read_text()


def test_only_its_own_old_drives_go(first: Finished, folder: Path) -> None:
    assert logs_in(folder) == sorted([log_name(FRAMES), f"{log_name(FRAMES)}.checksums", "mine.lcmlog"])


def test_a_second_call_uses_the_drive_again(tessera: Tessera, first: Finished, folder: Path) -> None:
    written_at = (folder / log_name(FRAMES)).stat().st_mtime_ns
    out = folder / "second"
    again = tessera.command(
        "demo", "--frames", FRAMES, "--logs", folder, "--out", out, "--port", tessera.next_port()
    ).must_end_well()
    assert "rendered before" in again.out and "rendering" not in again.out
    assert (folder / log_name(FRAMES)).stat().st_mtime_ns == written_at
    assert (out / "report.html").is_file()


@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_rendering_leaves_nothing(tessera: Tessera, tmp_path: Path, sign: signal.Signals) -> None:
    demo = tessera.start("demo", "--logs", tmp_path, "--port", tessera.next_port())
    deadline = time.monotonic() + RUN_TIMEOUT_S
    while not any(path.stat().st_size > 0 for path in tmp_path.iterdir()):
        assert demo.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    demo.send_signal(sign)
    out, _ = demo.communicate(timeout=RUN_TIMEOUT_S)
    assert demo.returncode == 1 and "interrupted" in out
    assert not list(tmp_path.iterdir())


def test_the_default_is_the_whole_drive(tessera: Tessera, tmp_path: Path) -> None:
    refused = tessera.command(
        "record",
        "sim:street-short",
        tmp_path / "none.lcmlog",
        "--sensor",
        "stereo",
        "--frames",
        f"{DEMO_FRAMES}:{DEMO_FRAMES + 1}",
    )
    assert refused.status == 2 and f"has {DEMO_FRAMES} frames" in refused.err


def test_the_sources_that_render_it_exist() -> None:
    assert [name for name in RENDERED_BY if not (ROOT / name).is_dir()] == []


def test_the_name_of_a_drive_says_what_it_is() -> None:
    assert log_name(60) != log_name(61)
    assert log_name(60) == log_name(60)
    assert "-60-" in log_name(60)


@pytest.mark.parametrize(
    "arguments, word",
    [
        (["--frames", "5"], "--frames"),
        (["--frames", DEMO_FRAMES + 1], "--frames"),
        (["--logs", "/no/such/folder"], "/no/such/folder"),
        (["--port", "80"], "--port"),
        (["twice"], "twice"),
    ],
)
def test_arguments_at_fault(tessera: Tessera, arguments: list[Any], word: str) -> None:
    refused = tessera.command("demo", *arguments)
    assert refused.status == 2 and word in refused.err and refused.err.count("\n") == 1, refused.err
