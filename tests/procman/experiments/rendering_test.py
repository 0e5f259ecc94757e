"""Which checkout renders a simulated world, and what is kept of it."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from helpers.stack import ROOT
from tessera_cli.experiments.checkouts import Checkout
from tessera_cli.experiments.plan import Sequence
from tessera_cli.experiments.rendering import render
from tessera_cli.files import BUILD
from tessera_cli.runs.recording import checksums_of

WORLD = Sequence("street", "stereo", "sim:street-short")


class Commands:
    """Writes what `tessera record` would, and counts how often."""

    def __init__(self) -> None:
        self.folders: list[Path] = []

    def run(self, _name: str, words: list[str], folder: Path, *_rest: Any) -> None:
        log = Path(words[words.index("record") + 2])
        log.write_text(str(folder))
        checksums_of(log).write_text("checksums")
        self.folders.append(folder)


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    """Of another commit, with the same message types."""
    folder = tmp_path / "checkout"
    (folder / "lcmtypes").mkdir(parents=True)
    for path in (ROOT / "lcmtypes").glob("*.lcm"):
        (folder / "lcmtypes" / path.name).write_bytes(path.read_bytes())
    return Checkout(folder, folder / "build", "0123456789abcdef", is_changed=False)


@pytest.fixture
def rendered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    view: Any = SimpleNamespace(say=lambda _: None, begin=lambda _: None, look=lambda _: None)

    def log(by: Checkout, commands: Any, sequence: Sequence = WORLD) -> Path:
        return Path(render(sequence, -1, by, commands, view).removeprefix("log:"))

    return log


def test_one_log_serves_checkouts_that_can_read_it(checkout: Checkout, rendered: Callable[..., Path]) -> None:
    commands = Commands()
    log = rendered(Checkout(ROOT, BUILD, "", is_changed=False), commands)
    assert rendered(checkout, commands) == log
    assert commands.folders == [ROOT]


def test_a_checkout_with_other_messages_renders_its_own(checkout: Checkout, rendered: Callable[..., Path]) -> None:
    commands = Commands()
    log = rendered(Checkout(ROOT, BUILD, "", is_changed=False), commands)
    (checkout.folder / "lcmtypes" / "camera_image_t.lcm").write_text("struct camera_image_t {}")
    assert rendered(checkout, commands) != log
    assert commands.folders == [ROOT, checkout.folder]


def test_its_checksums_stay_beside_a_log(checkout: Checkout, rendered: Callable[..., Path]) -> None:
    log = rendered(checkout, Commands())
    assert sorted(path.name for path in log.parent.iterdir()) == sorted([log.name, checksums_of(log).name])


def test_what_is_not_simulated_is_read_where_it_is(checkout: Checkout, rendered: Callable[..., Path]) -> None:
    assert rendered(checkout, Commands(), Sequence("KITTI 03", "mono", "kitti:somewhere")) == Path("kitti:somewhere")
