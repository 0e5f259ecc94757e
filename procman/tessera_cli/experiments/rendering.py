"""Simulated worlds as logs, rendered once and kept for all experiments, so that rendering does not count."""

import hashlib
import os
from pathlib import Path

from tessera_cli.experiments.checkouts import Checkout, cache_folder
from tessera_cli.experiments.commands import CommandRunner
from tessera_cli.experiments.plan import Sequence
from tessera_cli.experiments.progress_view import ProgressView
from tessera_cli.files import ROOT, replacing
from tessera_cli.runs.recording import checksums_of
from tessera_cli.simulator import simulator_hash


def render(sequence: Sequence, last: int, checkout: Checkout, commands: CommandRunner, view: ProgressView) -> str:
    """The source to run: of a simulated world, the log that it is rendered into, up to frame `last` (-1: all).

    A checkout whose messages are of other types than ours could not read our log: it renders its own.
    """
    kind, _, world = sequence.source.partition(":")
    if kind != "sim":
        return sequence.source
    frames = f"-{last}" if last >= 0 else ""
    name = f"{world.replace('/', '_')}-{sequence.sensor}{frames}-{_renderer(checkout, world)}.lcmlog"
    log = cache_folder() / "rendered" / name
    if not log.is_file():
        view.say(f"{checkout.name} renders {sequence.source} into {log} (once)")
        log.parent.mkdir(parents=True, exist_ok=True)
        view.begin(f"rendering {sequence.name}")
        with replacing(log) as written:  # an interrupted recording would keep what it has
            words = ["record", sequence.source, str(written), "--sensor", sequence.sensor]
            words += ["--frames", f"0:{last if last >= 0 else ''}"]
            commands.run(
                f"render_{sequence.key}",
                [*checkout.words, *words],
                checkout.folder,
                checkout.environment,
                view.look,
            )
        if checksums_of(written).is_file():  # older commits write none
            os.replace(checksums_of(written), checksums_of(log))
    return f"log:{log}"


def _renderer(checkout: Checkout, world: str) -> str:
    """Logs of the same renderer are the same."""
    if _type_texts(checkout.folder) == _type_texts(ROOT):
        return simulator_hash(world)
    # What renders lies elsewhere in older commits, so anything in their programs counts.
    return hashlib.sha256(f"{checkout.fingerprint()} {simulator_hash(world)}".encode()).hexdigest()[:12]


def _type_texts(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (folder / "lcmtypes").glob("*.lcm")}
