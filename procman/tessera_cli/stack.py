"""All processes of one run. Extractors that die, and stages that are killed, are started again, but for tracker and evaluator, whose death ends it."""

import time
from pathlib import Path

from tessera_cli.errors import RunFailed, UserError
from tessera_cli.files import BIN
from tessera_cli.processes import StageProcess, describe_exit

# A respawn waits this long, twice as long each time in a row.
FIRST_BACK_OFF_S = 0.1
LONGEST_BACK_OFF_S = 5.0
# An extractor that lived this long begins anew with the shortest wait.
STABLE_AFTER_S = 10.0
# One that dies so often in a row has a fault that starting it again does not mend.
MAX_DEATHS_IN_A_ROW = 6
# Stages that build their state again when they were killed.
REBUILT = ("mapper", "loop_closer", "global_adjuster", "reassembler", "dispatcher", "camera")
# What SIGTERM has not ended after this long is killed.
STOP_TIMEOUT_S = 5.0


class Stack:
    def __init__(self, settings_path: Path, log_dir: Path):
        self._settings_path = settings_path
        self._log_dir = log_dir
        self.processes: dict[str, StageProcess] = {}
        self.num_extractor_restarts = 0
        self.warnings: list[str] = []
        self._deaths_in_a_row: dict[str, int] = {}
        self._respawn_at: dict[str, float] = {}  # monotonic seconds
        self._is_source_ended = False

    def start(self, stage: str, instance: int | None = None) -> None:
        """`instance` numbers the processes of a stage that has several."""
        name = stage if instance is None else f"{stage}_{instance}"
        command = [str(BIN / f"tessera-{stage.replace('_', '-')}"), "--settings", str(self._settings_path), "--name", name,
                   "--id", str(instance or 0)]
        process = StageProcess(name, command, self._log_dir / f"{name}.log")
        try:
            process.start()
        except OSError as error:
            raise RunFailed(f"{name} could not be started: {error.strerror}: {command[0]}.") from error
        self.processes[name] = process

    def check(self) -> None:
        """Looks once at every process. Raises UserError or RunFailed when the run can't go on."""
        for process in self.processes.values():
            status = process.poll()
            if status is not None:
                self._handle_death(process, status)
        now = time.monotonic()
        for name in [name for name, due in self._respawn_at.items() if now >= due]:
            del self._respawn_at[name]
            self.processes[name].start()
            self.num_extractor_restarts += name.startswith("extractor_")

    def _handle_death(self, process: StageProcess, status: int) -> None:
        if process.name == "camera" and self._is_source_ended:
            return
        if status == 2:
            raise UserError(f"{process.name}: {process.last_words()}")
        # One that fails by its own decision would do so again; one that was killed gets what it lacks from the others.
        can_go_on = process.name.startswith("extractor_") or (process.name in REBUILT and status < 0)
        if not can_go_on:
            raise RunFailed(f"{process.name} {describe_exit(status)}; the last line of {process.log_path}: {process.last_words()}")
        lived_s = time.monotonic() - process.started_at
        deaths = 1 if lived_s > STABLE_AFTER_S else self._deaths_in_a_row.get(process.name, 0) + 1
        self._deaths_in_a_row[process.name] = deaths
        if deaths > MAX_DEATHS_IN_A_ROW:
            raise RunFailed(f"{process.name} died {deaths} times in a row; the last line of {process.log_path}: {process.last_words()}")
        self.warnings.append(f"{process.name} {describe_exit(status)} and was started again.")
        back_off_s = min(LONGEST_BACK_OFF_S, FIRST_BACK_OFF_S * 2 ** (deaths - 1))
        self._respawn_at[process.name] = time.monotonic() + back_off_s

    def owns(self, pid: int) -> bool:
        return any(pid in process.pids for process in self.processes.values())

    def end_source(self) -> None:
        """Asks the camera to end its stream; it does not count as a death."""
        self.processes["camera"].ask_to_end()
        self._is_source_ended = True

    def stop(self) -> None:
        """Ends all by asking, and kills what does not listen. The recorder goes first: the others still send it what it lacks."""
        self._respawn_at.clear()
        recorder = [process for process in self.processes.values() if process.name == "recorder"]
        _end(recorder, self.warnings)
        _end([process for process in self.processes.values() if process not in recorder], self.warnings)

    def kill(self) -> None:
        for process in self.processes.values():
            process.kill()
        _wait_for_all(list(self.processes.values()))


def _end(processes: list[StageProcess], warnings: list[str]) -> None:
    for process in processes:
        process.ask_to_end()
    if _wait_for_all(processes):
        return
    for process in processes:
        if process.pid is not None:
            warnings.append(f"{process.name} did not end within {STOP_TIMEOUT_S:.0f} s and was killed.")
            process.kill()
    _wait_for_all(processes)


def _wait_for_all(processes: list[StageProcess]) -> bool:
    """False if some still run after STOP_TIMEOUT_S."""
    deadline = time.monotonic() + STOP_TIMEOUT_S
    while time.monotonic() < deadline:
        for process in processes:
            process.poll()
        if all(process.pid is None for process in processes):
            return True
        time.sleep(0.01)
    return False
