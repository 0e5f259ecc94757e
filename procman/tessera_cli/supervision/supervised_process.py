"""One process as its deputy wants it: started when what it depends on is ready, watched, restarted, ended in time.

`step` compares what is wanted with what runs and does the next thing. All times are monotonic seconds.

  WAITING -> STARTING -> READY -> FINISHED         as its stage reports on STATUS; one that can be held already runs
                                                   while it waits, and prepares itself
  any of these -> BACKING_OFF -> STARTING          it failed and is restarted
               -> ENDED, FAILED                    it ended by itself, or failed and is not restarted
               -> STOPPING -> STOPPED or WAITING   it is no longer wanted, or wanted with another Launch
"""

import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from tessera_cli.constants import FIRST_BACK_OFF_S, LONGEST_BACK_OFF_S, SETTLED_AFTER_S, STABLE_AFTER_S
from tessera_cli.messages import procman_process_t as states
from tessera_cli.supervision.child_process import ChildProcess, Launch, describe_exit
from tessera_cli.supervision.log_file import ProcessLog
from tessera_cli.supervision.process_tree import Usage
from tessera_cli.text import visible

# A process that fails so often in a row has an error that restarts don't fix; auto_respawn = "always" never gives up.
MAX_FAILURES_IN_A_ROW = 6
# Of the last line of its output, which is quoted when it fails.
MAX_LINE_BYTES = 4000
STATE_NAMES = {
    states.WAITING: "waiting",
    states.STARTING: "starting",
    states.READY: "ready",
    states.FINISHED: "finished",
    states.BACKING_OFF: "backing off",
    states.STOPPING: "stopping",
    states.STOPPED: "stopped",
    states.ENDED: "ended",
    states.FAILED: "failed",
}
UP = (states.STARTING, states.READY, states.FINISHED)
READY = (states.READY, states.FINISHED)


@dataclass(frozen=True)
class Exit:
    """How a process ended."""

    status: int  # exit status; negative: by that signal
    description: str  # continues the process's name: "was killed by SIGKILL", "was not ready within 30 s"
    last_line: str  # of its output


@dataclass
class SupervisedProcess:
    """`step` is called regularly by the Supervisor."""

    name: str
    mark: str
    log: ProcessLog
    on_output: Callable[[str, bytes], None]  # name, what it wrote
    state: int = states.WAITING
    reason: str = ""
    wanted: Launch | None = None
    session: str = ""  # of the order that wants it; a new one restarts what ended or failed
    num_starts: int = 0
    started_at: float = 0.0
    usage: Usage = field(default_factory=Usage)
    cpu_s: float = 0.0  # of its processes that have ended, as accounted by the kernel
    max_rss_mb: float = 0.0  # the highest peak of them
    num_failures: int = 0  # unrequested ends, of any status
    last_exit: Exit | None = None  # of its last process, for whatever reason; None: it runs, or can't be started
    child: ChildProcess | None = None
    _running: Launch | None = None
    _heard_at: float = 0.0
    _due_at: float = 0.0
    _kill_at: float | None = None  # set from the request to end
    _kill_reason: str = ""  # set if the deputy has killed it
    _failures_in_a_row: int = 0
    _last_line: bytes = b""

    def set_wanted(self, launch: Launch | None, session: str) -> None:
        """None: it is to end."""
        if launch != self.wanted or (session != self.session and self.state in (states.ENDED, states.FAILED)):
            self._failures_in_a_row = 0
            if self.child is None:
                self.state, self.reason = (states.WAITING if launch else states.STOPPED), ""
        self.wanted, self.session = launch, session

    @property
    def is_idle(self) -> bool:
        return self.child is None and self.wanted is None

    @property
    def depends(self) -> tuple[str, ...]:
        """Of what runs; else of what is wanted."""
        launch = self._running or self.wanted
        return launch.depends if launch else ()

    @property
    def last_line(self) -> str:
        """Of its output."""
        return visible(self._last_line.decode(errors="replace").strip()) or "(it wrote nothing)"

    def on_stage_status(self, is_finished: bool, received_at: float) -> None:
        """Its stage reported that it runs."""
        self._heard_at = max(self._heard_at, received_at)
        if self.state in UP:
            self.state = states.FINISHED if is_finished else states.READY

    def extend_time_outs(self, pause_s: float, now: float) -> None:
        """The deputy itself was suspended and received nothing meanwhile."""
        self._heard_at = min(now, self._heard_at + pause_s)

    def step(self, now: float, is_not_ready: Callable[[str], bool], has_dependents: bool) -> None:
        """`is_not_ready`: of another process; `has_dependents`: others that need this one run, so it must not end."""
        if self.child is None:
            self._step_without_child(now, is_not_ready)
            return
        self._read(self.child)
        status = self.child.poll()
        may_descendants_end = self._kill_at is not None and now < self._kill_at and self.child.has_descendants()
        if status is not None and not may_descendants_end:
            self._on_exit(self.child, status, now)
        elif self.wanted is None or self.wanted != self._running or self._kill_at is not None:
            self._stop(self.child, now, has_dependents)
        elif self.child.is_held:
            if not self._must_wait(self.wanted, is_not_ready):
                self._release(self.child, now)
        elif status is None:
            self._watch(self.child, now)

    def _step_without_child(self, now: float, is_not_ready: Callable[[str], bool]) -> None:
        if self.wanted is None or self.state in (states.ENDED, states.FAILED):
            return
        if self.state == states.BACKING_OFF and now < self._due_at:
            return
        must_wait = self._must_wait(self.wanted, is_not_ready)
        if not must_wait or self.wanted.held:
            self._start(self.wanted, now, is_held=must_wait)

    def _must_wait(self, launch: Launch, is_not_ready: Callable[[str], bool]) -> bool:
        if missing := [name for name in launch.depends if is_not_ready(name)]:
            self.state, self.reason = states.WAITING, f"waits for {', '.join(missing)}"
        return bool(missing)

    def _start(self, launch: Launch, now: float, is_held: bool) -> None:
        self._kill_reason, self._kill_at, self._last_line, self.last_exit = "", None, b"", None
        try:
            self.child = ChildProcess(launch, self.mark, is_held)
        except (OSError, subprocess.SubprocessError) as error:
            self.state, self.reason = states.FAILED, f"can't be started: {error}"
            return
        self._running = launch
        self.num_starts += 1
        self.started_at = now
        if not is_held:
            self._begin(now)

    def _release(self, child: ChildProcess, now: float) -> None:
        child.release()
        self._begin(now)

    def _begin(self, now: float) -> None:
        if self.state == states.WAITING:
            self.reason = ""  # after a failure it keeps telling why the process was restarted
        self.state = states.STARTING
        self.started_at = self._heard_at = now

    def _watch(self, child: ChildProcess, now: float) -> None:
        assert self._running is not None
        options = self._running.options
        lived_s, silent_s = now - self.started_at, now - self._heard_at
        is_hanging = options.ready == "status" and 0 < options.hang_timeout_s < silent_s
        if self.state == states.STARTING and options.ready == "started" and lived_s > SETTLED_AFTER_S:
            self.state = states.READY
        elif self.state == states.STARTING and silent_s > options.ready_timeout_s:
            self._kill(child, f"was not ready within {options.ready_timeout_s:g} s")
        elif self.state in READY and is_hanging:
            self._kill(child, f"sent no status for {options.hang_timeout_s:g} s")
        elif 0 < options.memory_limit_mb < self.usage.rss_mb:
            limit = f"its limit of {options.memory_limit_mb:g}"
            self._kill(child, f"used {self.usage.rss_mb:.0f} MB, more than {limit}")

    def _kill(self, child: ChildProcess, reason: str) -> None:
        self._kill_reason = reason
        child.kill()

    def _stop(self, child: ChildProcess, now: float, has_dependents: bool) -> None:
        assert self._running is not None
        options = self._running.options
        if self._kill_at is None:
            if has_dependents:
                return
            self.state, self.reason = states.STOPPING, ""
            self._kill_at = now + options.stop_time_allowed
            child.signal_group(options.stop_signal)
        elif now >= self._kill_at:
            self.reason = f"did not end within {options.stop_time_allowed:g} s and was killed"
            child.kill()

    def _read(self, child: ChildProcess) -> None:
        while data := child.read():
            self.log.write(data)
            self.on_output(self.name, data)
            lines = [line for line in (self._last_line + data).splitlines(keepends=True) if line.strip()]
            self._last_line = lines[-1][-MAX_LINE_BYTES:] if lines else b""

    def _on_exit(self, child: ChildProcess, status: int, now: float) -> None:
        """The process has ended: its descendants are killed, and what comes next is decided."""
        child.kill()
        self._read(child)
        child.close()
        self.cpu_s, self.max_rss_mb = self.cpu_s + child.cpu_s, max(self.max_rss_mb, child.max_rss_mb)
        last_exit = Exit(status, self._kill_reason or describe_exit(status), self.last_line)
        launch, self.child, self._running, self.usage = self._running, None, None, Usage()
        self.last_exit = last_exit
        if self._kill_at is not None or launch is None or self.wanted != launch:
            self.state = states.WAITING if self.wanted else states.STOPPED
            return
        self.num_failures += 1
        self._failures_in_a_row = 1 if now - self.started_at > STABLE_AFTER_S else self._failures_in_a_row + 1
        if self._is_restarted(launch, last_exit):
            self.state = states.BACKING_OFF
            self._due_at = now + min(LONGEST_BACK_OFF_S, FIRST_BACK_OFF_S * 2 ** min(self._failures_in_a_row - 1, 10))
        else:
            self.state = states.ENDED if status == 0 and not self._kill_reason else states.FAILED
        explains_itself = status > 0 and not self._kill_reason
        self.reason = self.last_exit.description + (f": {last_exit.last_line}" if explains_itself else "")

    def _is_restarted(self, launch: Launch, last_exit: Exit) -> bool:
        mode, status = launch.options.auto_respawn, last_exit.status
        was_killed = status < 0 or bool(self._kill_reason)
        if mode == "always":
            return was_killed or status != 2
        if self._failures_in_a_row > MAX_FAILURES_IN_A_ROW:
            description = f"ended {self._failures_in_a_row} times in a row, the last time it {last_exit.description}"
            self.last_exit = replace(last_exit, description=description)
            return False
        return (mode == "failure" and (was_killed or status not in (0, 2))) or (mode == "killed" and was_killed)

    def kill(self) -> None:
        """At once, with its descendants."""
        if self.child is not None:
            self.child.kill()
