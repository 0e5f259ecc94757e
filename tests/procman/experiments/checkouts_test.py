"""What --against may be, and the sentences where it can't."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from helpers.stack import ROOT
from tessera_cli.errors import UserError
from tessera_cli.experiments.checkouts import Checkout, cache_folder, find_commit, other_checkout
from tessera_cli.files import BUILD
from tessera_cli.interrupt import Interrupt


def git(folder: Path, *words: str) -> str:
    identity = ["-c", "user.name=Test", "-c", "user.email=test@example.org"]
    return subprocess.run(
        ["git", "-C", str(folder), *identity, *words], check=True, capture_output=True, text=True
    ).stdout.strip()


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    git(tmp_path, "init", "-q")
    (tmp_path / "file").write_text("1")
    git(tmp_path, "add", "file")
    git(tmp_path, "commit", "-qm", "first")
    return tmp_path


def test_a_commit_is_found_by_any_of_its_names(repository: Path) -> None:
    full = git(repository, "rev-parse", "HEAD")
    assert find_commit(repository, "HEAD") == find_commit(repository, full[:9]) == full


@pytest.mark.parametrize("text", ["no-such-branch", "0123456789abcdef", "--help", "HEAD:file", ""])
def test_an_unknown_commit_is_refused(repository: Path, text: str) -> None:
    with pytest.raises(UserError, match="no such commit"):
        find_commit(repository, text)


def test_without_git_no_commit_can_be_built(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no git clone"):
        find_commit(tmp_path, "HEAD")


@pytest.fixture
def against(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Checkout]:
    """--against, without handling the signals of the tests' process."""
    monkeypatch.setattr("signal.signal", lambda *_: None)
    return lambda text: other_checkout(text, Interrupt(), lambda _line: None)


def test_a_checkout_that_is_not_built_is_refused(tmp_path: Path, against: Callable[[str], Checkout]) -> None:
    (tmp_path / "procman" / "tessera_cli").mkdir(parents=True)
    with pytest.raises(UserError, match="not built"):
        against(str(tmp_path))


def test_this_checkout_is_measured_with_its_own_build(against: Callable[[str], Checkout]) -> None:
    checkout = against(str(ROOT))
    assert (checkout.folder, checkout.build) == (ROOT, BUILD)


def make_checkout(folder: Path) -> Checkout:
    for name in ("build/bin/tessera-tracker", "config/default.yaml", "procman/local.pmd"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name)
    return Checkout(folder, folder / "build", "1234567890abcdef", is_changed=True)


@pytest.mark.parametrize("changed", ["build/bin/tessera-tracker", "config/default.yaml", "procman/local.pmd"])
def test_runs_of_other_programs_or_settings_are_told_apart(tmp_path: Path, changed: str) -> None:
    checkout = make_checkout(tmp_path)
    before = checkout.fingerprint()
    assert before == checkout.fingerprint()
    (tmp_path / changed).write_text("another")
    assert checkout.fingerprint() != before


def test_its_name_tells_commit_and_changes(tmp_path: Path) -> None:
    assert make_checkout(tmp_path).name == "1234567890ab with changes"


def test_builds_are_kept_in_the_cache_of_the_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "tessera"
