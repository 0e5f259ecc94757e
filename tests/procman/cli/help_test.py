"""--help and --version of every command, without anything installed."""

import subprocess

import pytest

from helpers.stack import ROOT, Tessera
from tessera_cli.cli.main import COMMANDS
from tessera_cli.versions import collect_versions, tessera_version

NAMES = [command.__name__.rpartition(".")[2] for command in COMMANDS]


@pytest.mark.parametrize("name", NAMES)
def test_every_command_explains_itself(tessera: Tessera, name: str) -> None:
    out = tessera.command(name, "--help").must_end_well().out
    assert out.startswith("usage: procman/tessera")
    usage = subprocess.run([ROOT / "procman" / "tessera", "help"], capture_output=True, text=True, check=True).stdout
    assert any(name in line.split()[:4] for line in usage.splitlines()), "procman/tessera lists it"


def test_help_needs_only_python() -> None:
    """-I and -S: neither site-packages nor PYTHONPATH."""
    code = f"""
import sys
sys.path.insert(0, {str(ROOT / "procman")!r})
from tessera_cli.cli.main import parse_arguments
parse_arguments(["run", "--help"])
"""
    finished = subprocess.run(["/usr/bin/python3", "-I", "-S", "-c", code], capture_output=True, text=True)
    assert finished.returncode == 0 and "kitti:DIR" in finished.stdout, finished.stderr


def test_the_version_is_that_of_the_file(tessera: Tessera) -> None:
    version = (ROOT / "VERSION").read_text().strip()
    assert tessera_version() == version
    assert tessera.command("--version").must_end_well().out == f"tessera {version}\n"
    script = subprocess.run([ROOT / "procman" / "tessera", "--version"], capture_output=True, text=True)
    assert script.stdout == f"tessera {version}\n", script.stderr


def test_a_run_records_the_version_first() -> None:
    name, version = next(iter(collect_versions().items()))
    assert name == "Tessera" and version.startswith(tessera_version())
