"""Runs one command after the other for an experiment, each with a log of its own; nothing outlives the experiment."""

import time
from collections.abc import Callable
from pathlib import Path

from tessera_cli.constants import EXPERIMENT_POLL_S, EXPERIMENT_STOP_TIMEOUT_S
from tessera_cli.errors import RunError
from tessera_cli.experiments.plan import read_complete
from tessera_cli.interrupt import Interrupt
from tessera_cli.supervision.command_list import LocalCommand
from tessera_cli.supervision.private_deputy import PrivateDeputy, single_process
from tessera_cli.supervision.state_folder import LogFolder


class CommandRunner:
    """Logs are FOLDER/NAME.log. Whatever an earlier experiment left running with this folder is ended."""

    def __init__(self, folder: Path, interrupt: Interrupt) -> None:
        """Raises UserError if another experiment uses the folder."""
        self._logs = LogFolder(folder, f"another command uses {folder}: wait for its end, or give another folder.")
        self._interrupt = interrupt

    def run(
        self,
        name: str,
        words: list[str],
        folder: Path,
        environment: dict[str, str],
        look: Callable[[str], None],
        run_folder: Path | None = None,
    ) -> float:
        """CPU seconds of the command and its descendants, when it has ended with status 0, or as a run in doubt.

        `look` gets the last line of its output, again and again. `run_folder`: that it writes, if it is a run.
        Raises UserError or RunError, with its last line and the log's path, if it failed; KeyboardInterrupt if
        interrupted, when it and its descendants have ended.
        """
        self._logs.log_path(name).unlink(missing_ok=True)
        process = single_process(name, name, EXPERIMENT_STOP_TIMEOUT_S)
        command = LocalCommand(name, tuple(words), folder, environment)
        deputy = PrivateDeputy(self._logs, self._logs.path, [process], {name: command})
        try:
            deputy.start()
            while not deputy.is_over:
                if self._interrupt.requested:
                    deputy.stop()
                    raise KeyboardInterrupt
                look(deputy.last_line(name))
                time.sleep(EXPERIMENT_POLL_S)
                deputy.step()
        except RunError:
            # A run whose scale may have slipped is a result, too.
            summary = read_complete(run_folder) if run_folder is not None else None
            if summary is None or not summary.get("doubts"):
                raise
        finally:
            deputy.kill()
        return sum(each.cpu_s for each in deputy.processes)
