"""The checkouts that an experiment compares: this one, and another commit that is built beside.

A commit gets a git worktree in the user's cache folder with a build folder of its own. Both are kept: the next
experiment against this commit uses them again.
"""

import hashlib
import os
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import psutil

from tessera_cli.console import say
from tessera_cli.errors import RunError, UserError
from tessera_cli.experiments.commands import CommandRunner
from tessera_cli.files import BUILD, ROOT, absolute, python_command
from tessera_cli.interrupt import Interrupt

# What a run consists of besides its Python sources; a change of any makes another program.
FINGERPRINTED = ("config/default.yaml", "procman/*.pmd")
# Everything that runs, in any commit: targets of CMake's folders, since targets of our own came later.
TARGETS = ("lcmtypes/all", "modules/all", "procman/all")
GIGABYTES_PER_JOB = 1.0  # that one heavy C++ file takes
SHORT = 12  # characters of a commit


@dataclass(frozen=True)
class Checkout:
    """Sources and their build, whose `tessera run` is measured."""

    folder: Path
    build: Path
    commit: str  # empty outside of git
    is_changed: bool  # it has changes that are not committed

    @property
    def name(self) -> str:
        commit = self.commit[:SHORT] or "no commit"
        return f"{commit} with changes" if self.is_changed else commit

    @property
    def words(self) -> list[str]:
        """The `tessera` command of this checkout, without its setup: nothing is built while runs are measured."""
        return python_command("tessera_cli")

    @property
    def environment(self) -> dict[str, str]:
        return {"PYTHONPATH": str(self.folder / "procman"), "TESSERA_BUILD": str(self.build)}

    def fingerprint(self) -> str:
        """SHA-256 of the programs, settings and process lists: runs of equal ones may be put together."""
        settings = [path for pattern in FINGERPRINTED for path in self.folder.glob(pattern)]
        digest = hashlib.sha256()
        for path in [*sorted((self.build / "bin").glob("tessera-*")), *sorted(settings)]:
            digest.update(f"{path.name}\0".encode() + hashlib.sha256(path.read_bytes()).digest())
        return digest.hexdigest()


def this_checkout() -> Checkout:
    return _describe(ROOT, BUILD)


def other_checkout(text: str, interrupt: Interrupt, look: Callable[[str], None]) -> Checkout:
    """Of --against: a commit, which is built if it isn't yet, or the folder of a checkout.

    `look` gets what the build says. Raises UserError if there is neither, RunError if the build fails.
    """
    folder = absolute(text)
    if (folder / "procman" / "tessera_cli").is_dir():
        checkout = _describe(folder.resolve(), BUILD if folder.resolve() == ROOT else folder.resolve() / "build")
        _require_programs(checkout)
        return checkout
    commit = find_commit(ROOT, text)
    here = this_checkout()
    if here.commit == commit and not here.is_changed:
        say(f"{text} is what this checkout holds: its own build is measured on both sides")
        return here
    return _build_beside(commit, interrupt, look)


def find_commit(repository: Path, text: str) -> str:
    """The full hash of a commit. Raises UserError if the repository has none of this name."""
    if _git(repository, "rev-parse", "--git-dir") is None:
        raise UserError(
            f"--against {text}: {repository} is no git clone that could give this commit; "
            "name the folder of another built checkout instead."
        )
    commit = None if text.startswith("-") else _git(repository, "rev-parse", "--verify", "-q", f"{text}^{{commit}}")
    if not commit:
        raise UserError(f"--against {text}: {repository} has no such commit, and there is no checkout of this name.")
    return commit


def _describe(folder: Path, build: Path) -> Checkout:
    commit = _git(folder, "rev-parse", "HEAD") or ""
    return Checkout(folder, build, commit, bool(commit and _git(folder, "status", "--porcelain", "-uno")))


def _require_programs(checkout: Checkout) -> None:
    if not (checkout.build / "bin" / "tessera-tracker").is_file():
        raise UserError(f"{checkout.folder} is not built: run procman/tessera setup there.")


def _git(folder: Path, *arguments: str) -> str | None:
    """Its output; None if it failed or is not installed."""
    try:
        finished = subprocess.run(["git", "-C", str(folder), *arguments], capture_output=True, text=True)
    except OSError:
        return None
    return finished.stdout.strip() if finished.returncode == 0 else None


def cache_folder() -> Path:
    """Of what experiments make once and keep."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tessera"


def _build_beside(commit: str, interrupt: Interrupt, look: Callable[[str], None]) -> Checkout:
    folder = cache_folder() / "checkouts" / commit[:SHORT]
    runner = CommandRunner(folder.with_name(f"{folder.name}-logs"), interrupt)
    _add_worktree(folder, commit)
    build = folder / "build"
    environment = {
        "CCACHE_BASEDIR": str(folder),
        "CCACHE_NOHASHDIR": "1",
        "CCACHE_SLOPPINESS": "pch_defines,time_macros",
    }
    _link_python(folder / ".venv")
    if not (build / "build.ninja").is_file():
        say(f"configuring {commit[:SHORT]} in {build}")
        runner.run("configure", _configure_words(folder, build), folder, environment, look)
    say(f"building {commit[:SHORT]}; the first time takes minutes")
    runner.run("build", ["ninja", "-C", str(build), "-j", str(_num_jobs()), *TARGETS], folder, environment, look)
    checkout = Checkout(folder, build, commit, is_changed=False)
    _require_programs(checkout)
    return checkout


def _add_worktree(folder: Path, commit: str) -> None:
    if (folder / ".git").exists() and _git(folder, "rev-parse", "HEAD") == commit:
        return
    # What is left of one that was not completed, or whose clone is gone.
    shutil.rmtree(folder, ignore_errors=True)
    words = ["git", "-C", str(ROOT), "worktree", "add", "--quiet", "--detach", "--force", "--force"]
    finished = subprocess.run([*words, str(folder), commit], capture_output=True, text=True)
    if finished.returncode != 0:
        raise RunError(f"git could not make a worktree of {commit[:SHORT]} in {folder}: {finished.stderr.strip()}")


def _link_python(link: Path) -> None:
    """LCM comes from this checkout's Python environment; at the same place, so that ccache knows what was compiled."""
    if not link.exists():
        link.unlink(missing_ok=True)  # the checkout that it led to is gone
        link.symlink_to(ROOT / ".venv")


def _configure_words(folder: Path, build: Path) -> list[str]:
    """As procman/setup.sh."""
    options = ["-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_COMPILE_WARNING_AS_ERROR=OFF"]
    if shutil.which("ccache"):
        options.append("-DCMAKE_CXX_COMPILER_LAUNCHER=ccache")
    return ["cmake", "-S", str(folder), "-B", str(build), "-G", "Ninja", *options]


def _num_jobs() -> int:
    gigabytes = psutil.virtual_memory().available / 1e9
    return max(1, min(len(os.sched_getaffinity(0)), int(gigabytes / GIGABYTES_PER_JOB)))
