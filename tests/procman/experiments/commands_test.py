"""Commands of an experiment: their logs, their failures, and that nothing outlives an interruption."""

import os
import time
from pathlib import Path

import pytest

from tessera_cli.errors import RunError, UserError
from tessera_cli.experiments.commands import CommandRunner
from tessera_cli.interrupt import Interrupt
from tessera_cli.supervision.process_tree import marked


@pytest.fixture
def interrupt(monkeypatch: pytest.MonkeyPatch) -> Interrupt:
    """Without handling the signals of the tests' process."""
    monkeypatch.setattr("signal.signal", lambda *_: None)
    return Interrupt()


def run(
    folder: Path, interrupt: Interrupt, script: str, run_folder: Path | None = None, **environment: str
) -> list[str]:
    """The last lines that were seen while it ran."""
    lines: list[str] = []
    words = ["sh", "-c", script]
    CommandRunner(folder, interrupt).run("script", words, folder, environment, lines.append, run_folder)
    return lines


def test_output_goes_into_a_log_of_its_own_and_the_last_line_is_seen(tmp_path: Path, interrupt: Interrupt) -> None:
    lines = run(tmp_path, interrupt, 'echo first; echo "$PLACE"; sleep 0.5', PLACE="second")
    assert (tmp_path / "script.log").read_text() == "first\nsecond\n"
    assert lines[-1] == "second"


def test_its_cpu_time_is_measured_with_its_descendants(tmp_path: Path, interrupt: Interrupt) -> None:
    work = "i=0; while [ $i -lt 300000 ]; do i=$((i+1)); done"
    runner = CommandRunner(tmp_path, interrupt)
    assert runner.run("script", ["sh", "-c", f"sh -c '{work}'; true"], tmp_path, {}, lambda _line: None) > 0.05


def test_a_log_holds_one_run(tmp_path: Path, interrupt: Interrupt) -> None:
    runner = CommandRunner(tmp_path, interrupt)
    for word in ("one", "two"):
        runner.run("script", ["echo", word], tmp_path, {}, lambda _line: None)
    assert (tmp_path / "script.log").read_text() == "two\n"


def test_a_failure_names_the_log(tmp_path: Path, interrupt: Interrupt) -> None:
    with pytest.raises(RunError, match=r"ended with status 3.*script\.log: no such target"):
        run(tmp_path, interrupt, "echo no such target; exit 3")


def test_arguments_at_fault_stay_a_user_error(tmp_path: Path, interrupt: Interrupt) -> None:
    with pytest.raises(UserError, match="there is no folder"):
        run(tmp_path, interrupt, "echo there is no folder; exit 2")


def test_a_run_that_doubts_its_scale_is_a_result(tmp_path: Path, interrupt: Interrupt) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run/summary.json").write_text('{"ended": "complete", "doubts": ["The scale may have slipped."]}')
    run(tmp_path, interrupt, "exit 1", tmp_path / "run")


def test_a_doubt_of_another_run_is_none_of_this_one(tmp_path: Path, interrupt: Interrupt) -> None:
    (tmp_path / "summary.json").write_text('{"ended": "complete", "doubts": ["The scale may have slipped."]}')
    with pytest.raises(RunError):
        run(tmp_path, interrupt, "exit 1", tmp_path / "run")


def test_a_run_that_failed_without_doubts_is_a_failure(tmp_path: Path, interrupt: Interrupt) -> None:
    (tmp_path / "summary.json").write_text('{"ended": "complete", "doubts": []}')
    with pytest.raises(RunError):
        run(tmp_path, interrupt, "exit 1", tmp_path)


def test_a_missing_program_is_a_failure(tmp_path: Path, interrupt: Interrupt) -> None:
    with pytest.raises(RunError, match="can't be started"):
        CommandRunner(tmp_path, interrupt).run("build", ["/no/such/program"], tmp_path, {}, lambda _line: None)


def test_an_interruption_ends_it_with_its_descendants(tmp_path: Path, interrupt: Interrupt) -> None:
    def look(line: str) -> None:
        interrupt.requested = line == "started"

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        CommandRunner(tmp_path, interrupt).run(
            "script", ["sh", "-c", "sleep 100 & echo started; wait"], tmp_path, dict(os.environ), look
        )
    assert time.monotonic() - began < 15
    assert not marked(f"{tmp_path}/")


def test_a_folder_serves_one_experiment_at_a_time(tmp_path: Path, interrupt: Interrupt) -> None:
    first = CommandRunner(tmp_path, interrupt)
    with pytest.raises(UserError, match="another command uses"):
        CommandRunner(tmp_path, interrupt)
    del first
