"""No code is taken from the folder that the user stands in, which may be anybody's, such as /tmp."""

import os
import subprocess
from pathlib import Path

import pytest

from helpers.nodes import MakeNode
from helpers.stack import ROOT, environment
from tessera_cli.files import python_command

# Ours, a package that we use, and two of the standard library; each says that it ran.
HOSTILE_MODULES = ("tessera_cli/__init__.py", "tessera_cli/__main__.py", "yaml.py", "signal.py", "tempfile.py")


@pytest.fixture
def hostile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder from now on."""
    folder = tmp_path / "hostile"
    for name in HOSTILE_MODULES:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(f"open({str(tmp_path / 'ran')!r}, 'a').write({name!r})\n")
    monkeypatch.chdir(folder)
    return folder


def must_not_have_run(folder: Path) -> None:
    ran = folder.parent / "ran"
    assert not ran.exists(), ran.read_text()


def test_the_script_takes_nothing_from_the_working_folder(hostile: Path) -> None:
    finished = subprocess.run(
        [ROOT / "procman" / "tessera", "status", "--help"],
        env={**os.environ, "PYTHONPATH": "."},
        capture_output=True,
        text=True,
    )
    must_not_have_run(hostile)
    assert finished.returncode == 0 and finished.stdout.startswith("usage: procman/tessera status"), finished.stderr


def test_commands_take_nothing_from_the_working_folder(hostile: Path) -> None:
    """A pair of commands that load settings: YAML."""
    finished = subprocess.run(
        [*python_command("tessera_cli"), "evaluate", hostile], env=environment(), capture_output=True, text=True
    )
    must_not_have_run(hostile)
    assert finished.returncode == 2 and "no run's folder" in finished.stderr, finished.stderr


def test_a_deputy_and_its_guard_take_nothing_from_the_working_folder(hostile: Path, make_node: MakeNode) -> None:
    node = make_node('cmd "sleeper" { exec = "sleep 1000"; }').start()
    assert node.up('cmd "sleeper" { host = "node1"; ready = "started"; }').returncode == 0
    node.kill()  # its guard ends the process
    node.start()
    assert node.end() == 0
    must_not_have_run(hostile)


def test_python_is_started_in_one_way() -> None:
    sources = [path for path in (ROOT / "procman" / "tessera_cli").rglob("*.py") if path.name != "files.py"]
    assert [path.name for path in sources if "sys.executable" in path.read_text()] == []
