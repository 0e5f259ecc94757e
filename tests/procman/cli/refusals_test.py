"""What the system refuses, and surroundings unlike those of developers: a sentence, or it works; never a trace."""

import os
import resource
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

from helpers.stack import ROOT, Tessera, environment
from tessera_cli.files import python_command


def run_in(shell: str, *words: object, **variables: str) -> "subprocess.CompletedProcess[str]":
    """The command at the place of "$@" of a shell script."""
    return subprocess.run(
        ["sh", "-c", shell, "sh", *python_command("tessera_cli"), *map(str, words)],
        env={**environment(), **variables},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )


def must_be_a_sentence(finished: "subprocess.CompletedProcess[str]", *words: str) -> None:
    assert finished.returncode == 1, finished.stdout + finished.stderr
    assert finished.stderr.startswith("tessera: ") and finished.stderr.count("\n") == 1, finished.stderr
    for word in words:
        assert word in finished.stderr


@pytest.mark.parametrize("words", [("keys",), ("--help",), ("run", "--help"), ("--version",)])
def test_output_on_a_full_device(words: tuple[str, ...]) -> None:
    finished = run_in('exec "$@" > /dev/full', *words)
    must_be_a_sentence(finished, "the output of this command can't be written: No space left on device.")


def test_a_reader_that_has_gone() -> None:
    finished = run_in('"$@" | true', "run", "--help")
    assert finished.stderr == ""


def test_few_open_files(tmp_path: Path) -> None:
    finished = run_in('ulimit -n 16; exec "$@"', "run", "sim:street-short", "--out", tmp_path / "run")
    must_be_a_sentence(finished, "16 files", "ulimit -n 1024")
    assert not (tmp_path / "run").exists()


def test_a_low_limit_of_open_files_is_raised_where_that_is_allowed() -> None:
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    assert hard == resource.RLIM_INFINITY or hard >= 1024
    assert run_in('ulimit -S -n 16; exec "$@"', "keys").returncode == 0


@pytest.mark.parametrize(
    "variables", [{"LC_ALL": "C", "PYTHONUTF8": "0"}, {"LC_ALL": "POSIX", "PYTHONIOENCODING": "ascii"}]
)
def test_paths_with_umlauts_in_any_locale(
    tessera: Tessera, sequence: Path, tmp_path: Path, variables: dict[str, str]
) -> None:
    out = tmp_path / "Straße in München"
    shutil.copytree(sequence, tmp_path / "übung")
    options = ("--frames", "0:20", "--extractors", 1, "--port", tessera.next_port(), "--out", out)
    finished = run_in('exec "$@"', "run", f"kitti:{tmp_path / 'übung'}", *options, **variables)
    assert finished.returncode == 0, finished.stderr
    assert "übung" in (out / "report.html").read_text()


@pytest.fixture
def as_nobody() -> list[str]:
    """Words before a command."""
    if os.geteuid() != 0 or not shutil.which("setpriv"):
        pytest.skip("only root can act for another user, by setpriv")
    return ["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"]


def test_a_checkout_of_root(as_nobody: list[str]) -> None:
    """As an ordinary user, who can read it."""
    with tempfile.TemporaryDirectory() as top:
        Path(top).chmod(0o755)
        shutil.copytree(ROOT / "procman", Path(top) / "procman")
        words = [*as_nobody, f"{top}/procman/tessera", "keys"]
        finished = subprocess.run(words, capture_output=True, text=True)
        assert not (Path(top) / "logs" / ".setup.lock").exists()
    must_be_a_sentence(finished, "belongs to root", "can't write into", "use a checkout of your own")


def test_a_folder_of_another_user(as_nobody: list[str]) -> None:
    with tempfile.TemporaryDirectory() as top:
        (Path(top) / "run").mkdir(mode=0o700)
        Path(top).chmod(0o755)
        words = [*as_nobody, *python_command("tessera_cli"), "evaluate", f"{top}/run"]
        finished = subprocess.run(words, env=environment(), capture_output=True, text=True)
    must_be_a_sentence(finished, "Permission denied")
