"""The deputy of one command, with processes that need no build: how they end, in which order, and none outlives it."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from helpers.stack import ROOT, environment, read_line, wait_for
from tessera_cli.errors import RunError, UserError
from tessera_cli.messages import procman_process_t as states
from tessera_cli.supervision.attributes import RunOptions
from tessera_cli.supervision.child_process import ChildProcess, Launch
from tessera_cli.supervision.command_list import read_command_list
from tessera_cli.supervision.private_deputy import PrivateDeputy
from tessera_cli.supervision.process_list import Process, read_process_list
from tessera_cli.supervision.process_tree import marked
from tessera_cli.supervision.progress import FINISHED, RUNNING, StageReport
from tessera_cli.supervision.state_folder import LogFolder, StateFolder
from tessera_cli.supervision.supervised_process import STATE_NAMES

COMMANDS = """
cmd "sleeper"  { exec = "sleep 1000"; }
cmd "deaf"     { exec = "sh -c 'trap \\"\\" TERM; echo what; while true; do sleep 0.1; done'"; }
cmd "oneshot"  { exec = "sh -c 'echo all is done'"; }
cmd "refuser"  { exec = "sh -c 'echo tessera-camera: there is no folder X >&2; exit 2'"; }
cmd "faulty"   { exec = "sh -c 'echo the disk is missing; exit 3'"; }
cmd "busy"     { exec = "sh -c 'while true; do true; done'"; }
cmd "absent"   { exec = "/no/such/program"; }
cmd "holdable" { exec = "sh -c 'echo prepared $1; cat; echo begun; exec sleep 1000' sh"; held = "--held"; }
"""
STARTED = {"ready": "started", "auto_respawn": "never"}


def process(command: str, name: str = "", depends: tuple[str, ...] = (), **options: Any) -> Process:
    return Process(name or command, command, "", 0, depends, RunOptions(**{**STARTED, **options}))


MakeDeputy = Callable[..., PrivateDeputy]


@pytest.fixture
def make_deputy(tmp_path: Path) -> Iterator[MakeDeputy]:
    (tmp_path / "commands.pmd").write_text(COMMANDS)
    made: list[PrivateDeputy] = []

    def make(*processes: Process) -> PrivateDeputy:
        folder = LogFolder(tmp_path / f"logs {len(made)}", "it is taken.")
        made.append(
            PrivateDeputy(folder, tmp_path / "settings.yaml", processes, read_command_list(tmp_path / "commands.pmd"))
        )
        made[-1].start()
        return made[-1]

    yield make
    for deputy in made:
        deputy.kill()
    assert not marked(f"{tmp_path}/"), "nothing is left"


def step_until(deputy: PrivateDeputy, condition: Callable[[], object], what: str) -> None:
    def holds() -> object:
        deputy.step()
        return condition()

    wait_for(holds, what)


def test_tells_who_is_at_work(make_deputy: MakeDeputy) -> None:
    deputy = make_deputy(process("sleeper"), process("busy"))
    step_until(deputy, lambda: deputy.is_busy(["sleeper", "busy"]), "one of them is busy")
    assert deputy.is_busy(["busy"]) and not deputy.is_busy(["sleeper"]) and not deputy.is_busy([])


def pid_of(deputy: PrivateDeputy, name: str) -> int:
    return next(each.child.pid for each in deputy.processes if each.name == name and each.child)


def report(deputy: PrivateDeputy, name: str, state: int) -> StageReport:
    return StageReport(
        name, "host", pid_of(deputy, name), 0, state, 0, 0, 0, 0, 0, 0, 0.0, 0.0, 0.0, "", {}, time.monotonic()
    )


def test_what_is_killed_is_started_again_and_a_sentence_says_so(make_deputy: MakeDeputy) -> None:
    deputy = make_deputy(process("sleeper", auto_respawn="killed"))
    first = pid_of(deputy, "sleeper")
    os.kill(first, signal.SIGKILL)
    step_until(deputy, lambda: deputy.num_restarts("sleeper") == 1, "its return")
    assert deputy.warnings == ["sleeper was killed by SIGKILL and was restarted."]
    assert deputy.owns(first) and deputy.owns(pid_of(deputy, "sleeper"))


@pytest.mark.parametrize(
    "command, error, sentence",
    [
        ("refuser", UserError, "refuser: there is no folder X"),
        ("faulty", RunError, "faulty ended with status 3; the last line of {logs}/faulty.log: the disk is missing"),
        ("absent", RunError, "absent can't be started: "),
    ],
)
def test_one_that_is_beyond_help_is_told_in_a_sentence(
    make_deputy: MakeDeputy, tmp_path: Path, command: str, error: type[Exception], sentence: str
) -> None:
    with pytest.raises(error) as raised:
        step_until(make_deputy(process(command)), lambda: False, "its end")
    assert str(raised.value).startswith(sentence.format(logs=tmp_path / "logs 0"))


def test_one_that_dies_again_and_again_is_given_up(make_deputy: MakeDeputy, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tessera_cli.supervision.supervised_process.FIRST_BACK_OFF_S", 0.0)
    deputy = make_deputy(process("faulty", auto_respawn="failure"))
    with pytest.raises(
        RunError, match=r"faulty ended 7 times in a row, the last time it ended with status 3; .*: the disk is missing"
    ):
        step_until(deputy, lambda: False, "its end")
    assert len(deputy.warnings) == 6


def test_one_that_ends_well_has_ended(make_deputy: MakeDeputy) -> None:
    deputy = make_deputy(process("oneshot"))
    step_until(deputy, lambda: deputy.is_over, "its end")
    deputy.require_success("oneshot")
    assert deputy.ended == ["oneshot"] and deputy.last_line("oneshot") == "all is done"


def test_a_status_makes_ready_and_silence_is_a_hang(make_deputy: MakeDeputy) -> None:
    deputy = make_deputy(
        process("sleeper", "stage", ready="status", hang_timeout_s=0.3, auto_respawn="killed"),
        process("sleeper", "last", depends=("stage",)),
    )
    assert deputy.not_ready == ["stage", "last"]

    def is_all_ready() -> bool:
        deputy.on_stage_reports([report(deputy, "stage", RUNNING)])  # as long as the other one takes
        return not deputy.not_ready

    step_until(deputy, is_all_ready, "the one that depends on it")
    step_until(deputy, lambda: deputy.warnings, "the hang")
    assert deputy.warnings == ["stage sent no status for 0.3 s and was restarted."]


def test_what_can_be_held_prepares_itself_while_it_waits(make_deputy: MakeDeputy) -> None:
    deputy = make_deputy(process("sleeper", "stage", ready="status"), process("holdable", depends=("stage",)))
    step_until(deputy, lambda: deputy.last_line("holdable") == "prepared --held", "its start")
    time.sleep(0.5)
    deputy.step()
    held = deputy.processes[1]
    assert (STATE_NAMES[held.state], held.reason) == ("waiting", "waits for stage")
    assert deputy.last_line("holdable") == "prepared --held"
    deputy.on_stage_reports([report(deputy, "stage", RUNNING)])
    step_until(deputy, lambda: not deputy.not_ready, "its work")
    assert deputy.last_line("holdable") == "begun" and held.num_starts == 1 and held.reason == ""


def test_what_need_not_wait_is_not_held(make_deputy: MakeDeputy) -> None:
    deputy = make_deputy(process("holdable"))
    step_until(deputy, lambda: not deputy.not_ready, "its work")
    assert deputy.last_line("holdable") == "begun"


def test_what_is_killed_while_it_is_held_is_held_again(make_deputy: MakeDeputy) -> None:
    deputy = make_deputy(
        process("sleeper", "stage", ready="status"), process("holdable", depends=("stage",), auto_respawn="killed")
    )
    os.kill(pid_of(deputy, "holdable"), signal.SIGKILL)
    step_until(deputy, lambda: deputy.num_restarts("holdable") == 1, "its return")
    step_until(deputy, lambda: deputy.last_line("holdable") == "prepared --held", "its preparation")
    assert deputy.not_ready == ["stage", "holdable"]
    deputy.on_stage_reports([report(deputy, "stage", RUNNING)])
    step_until(deputy, lambda: not deputy.not_ready, "its work")


def test_nobody_is_needed_by_what_is_held(make_deputy: MakeDeputy) -> None:
    deputy = make_deputy(process("sleeper", "stage", ready="status"), process("holdable", depends=("stage",)))
    step_until(deputy, lambda: deputy.last_line("holdable") == "prepared --held", "its start")
    deputy.request_stop(["stage"])
    step_until(deputy, lambda: deputy.processes[0].state == states.STOPPED, "its end")
    assert deputy.processes[1].child is not None


def test_who_was_stopped_itself_takes_nobody_for_hung(make_deputy: MakeDeputy) -> None:
    deputy = make_deputy(process("sleeper", ready="status", hang_timeout_s=0.5))
    deputy.on_stage_reports([report(deputy, "sleeper", RUNNING)])
    time.sleep(1.2)  # as after Ctrl-Z and fg
    deputy.step()
    assert not deputy.not_ready
    with pytest.raises(RunError, match=r"sent no status for 0\.5 s"):
        step_until(deputy, lambda: False, "the hang")


def test_the_end_comes_in_order_but_for_what_has_done_its_work(make_deputy: MakeDeputy) -> None:
    deputy = make_deputy(
        process("sleeper", "recorder"),
        process("sleeper", "camera", ("recorder",), ready="status"),
        process("sleeper", "tracker"),
    )
    step_until(deputy, lambda: deputy.not_ready == ["camera"], "the others")
    deputy.step()
    deputy.on_stage_reports([report(deputy, "camera", FINISHED)])
    deputy.stop(["recorder"])
    states = {member.name: STATE_NAMES[member.state] for member in deputy.processes}
    assert states == {"recorder": "stopped", "camera": "finished", "tracker": "ready"}
    deputy.stop()
    assert deputy.is_over and deputy.warnings == []


def test_what_depends_on_it_and_still_works_ends_first(make_deputy: MakeDeputy) -> None:
    deputy = make_deputy(
        process("sleeper", "recorder"), process("sleeper", "camera", ("recorder",)), process("sleeper", "tracker")
    )
    step_until(deputy, lambda: not deputy.not_ready, "all")
    deputy.stop(["recorder"])
    states = {member.name: STATE_NAMES[member.state] for member in deputy.processes}
    assert states == {"recorder": "stopped", "camera": "stopped", "tracker": "ready"}


def test_what_does_not_listen_is_killed_and_that_is_told_once(make_deputy: MakeDeputy) -> None:
    deputy = make_deputy(process("deaf", stop_time_allowed=0.2))
    step_until(deputy, lambda: deputy.last_line("deaf") == "what", "its deafness")
    deputy.stop(["deaf"])
    deputy.stop()
    assert deputy.warnings == ["deaf did not end within 0.2 s and was killed."]


def test_processor_time_and_memory_add_up_over_lives(make_deputy: MakeDeputy) -> None:
    deputy = make_deputy(process("deaf", auto_respawn="always"))
    (member,) = deputy.processes

    def has_failed(times: int) -> bool:
        return member.num_failures == times

    for life in (1, 2):
        before = member.cpu_s
        step_until(deputy, lambda: member.child is not None, "its start")
        assert member.child is not None
        os.kill(member.child.pid, signal.SIGKILL)
        step_until(deputy, partial(has_failed, life), "its end")
        assert member.cpu_s > before
    assert 0 < member.max_rss_mb < 50


def test_peak_memory_is_the_process_own_and_not_what_the_deputy_had(tmp_path: Path) -> None:
    ballast = bytearray(b"x" * 100_000_000)
    child = ChildProcess(
        Launch(("sleep", "0.3"), "", tmp_path, (), "sleeper", (), RunOptions(), "", 0), f"{tmp_path}/sleeper"
    )
    wait_for(lambda: child.poll() is not None, "its end")
    child.close()
    assert len(ballast) > 0
    assert 0 < child.max_rss_mb < 50


def test_a_folder_belongs_to_one_deputy_at_a_time(tmp_path: Path) -> None:
    first = LogFolder(tmp_path / "logs", "it is taken.")
    with pytest.raises(UserError, match="it is taken"):
        LogFolder(first.path, "it is taken.")


TAKES_FOLDER = """
import sys
from pathlib import Path
from tessera_cli.supervision.state_folder import LogFolder
LogFolder(Path(sys.argv[1]), "it is taken.")
"""
OTHER_USER = """
import fcntl, os, sys
os.setgroups([])
os.setuid(65534)
kept = []
for path in (sys.argv[1], sys.argv[1] + "/.lock"):
    try:
        kept.append(os.open(path, os.O_RDONLY))
        fcntl.flock(kept[-1], fcntl.LOCK_EX | fcntl.LOCK_NB)
        print("holds", os.path.basename(path), flush=True)
    except OSError as error:
        print(error.strerror, flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can act for another user")
def test_no_other_user_can_keep_a_folder_from_its_owner() -> None:
    with tempfile.TemporaryDirectory() as top:
        Path(top).chmod(0o755)
        folder = Path(top) / "logs"
        take = [sys.executable, "-c", TAKES_FOLDER, str(folder)]
        subprocess.run(take, env=environment(), check=True)
        words = ["/usr/bin/python3", "-I", "-c", OTHER_USER, str(folder)]
        with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
            assert read_line(other) == "holds logs\n"
            assert read_line(other) == "Permission denied\n"
            subprocess.run(take, env=environment(), check=True)


def test_only_the_owner_reads_a_deputys_folder(tmp_path: Path) -> None:
    folder = StateFolder(tmp_path / "state", "node1")
    folder.keep_order("list", b"order")
    assert folder.path.stat().st_mode & 0o777 == 0o700
    assert (folder.path / "orders" / "list").stat().st_mode & 0o777 == 0o600


KILLED = """
import os, signal, sys
from pathlib import Path
from tessera_cli.supervision.private_deputy import PrivateDeputy
from tessera_cli.supervision.command_list import read_command_list
from tessera_cli.supervision.process_list import read_process_list
from tessera_cli.supervision.state_folder import LogFolder
folder = Path(sys.argv[1])
processes = read_process_list(folder / "list.pmd").processes.values()
deputy = PrivateDeputy(LogFolder(folder / "logs", ""), folder, processes, read_command_list(folder / "commands.pmd"))
deputy.start()
print("started", flush=True)
signal.pause()
"""


def test_not_even_a_grandchild_in_a_session_of_its_own_outlives_a_killed_deputy(tmp_path: Path) -> None:
    (tmp_path / "commands.pmd").write_text('cmd "family" { exec = "sh -c \'setsid sleep 1001 & sleep 1002; wait\'"; }')
    (tmp_path / "list.pmd").write_text('cmd "family" { ready = "started"; }')
    deputy = subprocess.Popen(
        [sys.executable, "-c", KILLED, tmp_path], env=environment(), stdout=subprocess.PIPE, text=True
    )
    assert read_line(deputy) == "started\n"
    wait_for(lambda: len(marked(f"{tmp_path}/")) == 3, "the family")
    deputy.kill()
    deputy.wait()
    wait_for(lambda: not marked(f"{tmp_path}/"), "the end of the orphans")


def test_a_run_has_as_many_processes_as_it_says() -> None:
    path = ROOT / "procman" / "local.pmd"
    run = read_process_list(path, {"extractor": 3, "recorder": 1, "camera": 1}).processes
    assert [name for name in run if "extractor" in name] == ["extractor_0", "extractor_1", "extractor_2"]
    assert set(run["camera"].depends) == set(run) - {"camera"} and "recorder" in run
    assert list(run)[-1] == "camera"
    one = read_process_list(path, {"extractor": 1, "recorder": 0, "camera": 0}).processes
    assert "extractor_0" in one and "recorder" not in one and "camera" not in one
