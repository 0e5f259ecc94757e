"""Simulated worlds as logs, rendered once and kept for all experiments, so that rendering does not count."""

from tessera_cli.experiments.checkouts import Checkout, cache_folder
from tessera_cli.experiments.commands import CommandRunner
from tessera_cli.experiments.plan import Sequence
from tessera_cli.experiments.progress_view import ProgressView
from tessera_cli.files import replacing
from tessera_cli.simulator import simulator_hash


def render(sequence: Sequence, last: int, checkout: Checkout, commands: CommandRunner, view: ProgressView) -> str:
    """The source to run: of a simulated world, the log that it is rendered into, up to frame `last` (-1: all)."""
    kind, _, world = sequence.source.partition(":")
    if kind != "sim":
        return sequence.source
    frames = f"-{last}" if last >= 0 else ""
    name = f"{world.replace('/', '_')}-{sequence.sensor}{frames}-{simulator_hash(world)}.lcmlog"
    log = cache_folder() / "rendered" / name
    if not log.is_file():
        view.say(f"rendering {sequence.source} into {log} (once)")
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
    return f"log:{log}"
