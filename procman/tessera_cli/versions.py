"""What a run was made with: Tessera's version and commit, the libraries that the build found, and the machine."""

import datetime
import json
import os
import platform
import subprocess
from pathlib import Path

from tessera_cli.files import BUILD, ROOT


def tessera_version() -> str:
    """Of the file VERSION, which CMake reads too; "unknown" if there is none."""
    try:
        return (ROOT / "VERSION").read_text().strip()
    except OSError:
        return "unknown"


def collect_versions() -> dict[str, str]:
    """Names and versions, in the order in which to show them. What is unknown is left out."""
    commit, built = _commit(), _of_build(BUILD / "versions.json")
    built.pop("Tessera", None)  # of the build's time; the one below is of these sources
    versions = {
        "Tessera": tessera_version() + (f", commit {commit}" if commit else ""),
        **built,
        "Python": platform.python_version(),
        "system": f"{_system()}, Linux {platform.release()}",
        "CPU": f"{_cpu()}, {os.cpu_count()} cores",
        "date": f"{datetime.datetime.now().astimezone():%Y-%m-%d %H:%M %Z}",
    }
    return {name: version for name, version in versions.items() if version}


def _commit() -> str:
    """Empty outside of a git checkout."""

    def git(*arguments: str) -> str:
        finished = subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True)
        return finished.stdout.strip() if finished.returncode == 0 else ""

    try:
        commit = git("rev-parse", "--short=12", "HEAD")
        is_changed = bool(commit and git("status", "--porcelain", "-uno"))
    except OSError:
        return ""
    return commit + (", with changes that are not committed" if is_changed else "")


def _of_build(path: Path) -> dict[str, str]:
    """What CMake found when it configured the build."""
    try:
        found = json.loads(path.read_text())
    except (OSError, ValueError):
        return {}
    return {name: version for name, version in found.items() if name.lower() != "tessera"}


def _system() -> str:
    try:
        return platform.freedesktop_os_release().get("PRETTY_NAME", "Linux")
    except OSError:
        return "Linux"


def _cpu() -> str:
    """The model's name, or the architecture where the kernel doesn't tell it."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.machine()
