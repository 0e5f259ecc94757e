"""One process as its deputy wants it: started when what it depends on is ready, watched, started again, ended in time.

`step` compares what is wanted with what runs and does the next thing. All times are monotonic seconds.

  WAITING -> STARTING -> READY -> FINISHED         its stage says so on STATUS
  any of these -> BACKING_OFF -> STARTING          it died and is worth another try
               -> ENDED, FAILED                    it ended by itself, or is not worth another try
               -> STOPPING -> STOPPED or WAITING   it is not wanted any more, or other than it runs
"""

import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from tessera_cli.messages import procman_process_t as states
from tessera_cli.supervision.child_process import Child, Launch, describe_exit
from tessera_cli.supervision.log_file import RotatingLog
from tessera_cli.supervision.process_tree import Usage

# A start after a death waits this long, twice as long each time in a row.
FIRST_BACK_OFF_S = 0.1
LONGEST_BACK_OFF_S = 5.0
# One of ready = "started" that lived this long is ready: what ends at once with an error never was.
SETTLED_AFTER_S = 0.3
# One that lived this long begins anew with the shortest wait.
STABLE_AFTER_S = 10.0
# One that dies so often in a row has a fault that starting it again does not mend; auto_respawn = "always" tries for ever.
MAX_DEATHS_IN_A_ROW = 6
# Of its output, what is kept to be quoted as its last words.
MAX_LINE = 4000
STATE_NAMES = {
    getattr(states, name): name.lower().replace("_", " ")
    for name in ("WAITING", "STARTING", "READY", "FINISHED", "BACKING_OFF", "STOPPING", "STOPPED", "ENDED", "FAILED")
}
UP = (states.STARTING, states.READY, states.FINISHED)
READY = (states.READY, states.FINISHED)


@dataclass(frozen=True)
class Death:
    status: int  # exit status; negative: by that signal
    how: str  # goes on after its name: "was killed by SIGKILL", "was not ready within 30 s"
    last_words: str  # the last line of its output


@dataclass
class Supervised:
    name: str
    mark: str
    log: RotatingLog
    on_output: Callable[[str, bytes], None]  # name, what it wrote
    state: int = states.WAITING
    reason: str = ""
    wanted: Launch | None = None
    session: str = ""  # of the order that wants it; a new one tries again what ended or failed
    num_starts: int = 0
    started_at: float = 0.0
    usage: Usage = field(default_factory=Usage)
    cpu_s: float = 0.0  # of the lives that are over, as the kernel accounts them
    max_rss_mb: float = 0.0  # the highest peak of them
    num_deaths: int = 0  # ends that nobody had asked for
    last_death: Death | None = None  # of the last life, however it ended; None: it lives, or can't be started
    child: Child | None = None
    _running: Launch | None = None
    _heard_at: float = 0.0
    _due_at: float = 0.0
    _kill_at: float | None = None  # set while it is asked to end
    _fate: str = ""  # why we killed it
    _deaths: int = 0
    _last_line: bytes = b""

    def want(self, launch: Launch | None, session: str) -> None:
        if launch != self.wanted or (session != self.session and self.state in (states.ENDED, states.FAILED)):
            self._deaths = 0
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
    def last_words(self) -> str:
        return self._last_line.decode(errors="replace").strip() or "(it said nothing)"

    def on_stage_status(self, is_finished: bool, heard_at: float) -> None:
        """Its stage said that it runs."""
        self._heard_at = max(self._heard_at, heard_at)
        if self.state in UP:
            self.state = states.FINISHED if is_finished else states.READY

    def excuse(self, pause_s: float, now: float) -> None:
        """The deputy itself stood still, and heard nobody meanwhile."""
        self._heard_at = min(now, self._heard_at + pause_s)

    def step(self, now: float, not_ready: Callable[[str], bool], has_dependents: bool) -> None:
        """`not_ready` of another process; `has_dependents`: some that need this one still run, so it must not end yet."""
        if self.child is None:
            self._step_without_child(now, not_ready)
            return
        self._read()
        status = self.child.poll()
        if status is not None and not (self._kill_at and now < self._kill_at and self.child.has_descendants()):
            self._bury(status, now)
        elif self.wanted != self._running or self._kill_at is not None:
            self._stop(now, has_dependents)
        elif status is None:
            self._watch(now)

    def _step_without_child(self, now: float, not_ready: Callable[[str], bool]) -> None:
        if self.wanted is None or self.state in (states.ENDED, states.FAILED):
            return
        if self.state == states.BACKING_OFF and now < self._due_at:
            return
        if missing := [name for name in self.wanted.depends if not_ready(name)]:
            self.state, self.reason = states.WAITING, f"waits for {', '.join(missing)}"
            return
        self._start(now)

    def _start(self, now: float) -> None:
        self._running, self._fate, self._kill_at, self._last_line, self.last_death = self.wanted, "", None, b"", None
        if self.state == states.WAITING:
            self.reason = ""  # after a death it says on what account it was started again
        try:
            self.child = Child(self._running, self.mark)
        except (OSError, subprocess.SubprocessError) as error:
            self._running = None
            self.state, self.reason = states.FAILED, f"can't be started: {error}"
            return
        self.num_starts += 1
        self.started_at = self._heard_at = now
        self.state = states.STARTING

    def _watch(self, now: float) -> None:
        options = self._running.options
        if self.state == states.STARTING and options.ready == "started" and now - self.started_at > SETTLED_AFTER_S:
            self.state = states.READY
        elif self.state == states.STARTING and now - self._heard_at > options.ready_timeout_s:
            self._kill(f"was not ready within {options.ready_timeout_s:g} s")
        elif self.state in READY and options.ready == "status" and 0 < options.hang_timeout_s < now - self._heard_at:
            self._kill(f"said nothing for {options.hang_timeout_s:g} s")
        elif 0 < options.memory_limit_mb < self.usage.rss_mb:
            self._kill(f"used {self.usage.rss_mb:.0f} MB, more than its limit of {options.memory_limit_mb:g}")

    def _kill(self, fate: str) -> None:
        self._fate = fate
        self.child.end()

    def _stop(self, now: float, has_dependents: bool) -> None:
        if self._kill_at is None:
            if has_dependents:
                return
            self.state, self.reason = states.STOPPING, ""
            self._kill_at = now + self._running.options.stop_time_allowed
            self.child.ask_to_end(self._running.options.stop_signal)
        elif now >= self._kill_at:
            self.reason = f"did not end within {self._running.options.stop_time_allowed:g} s and was killed"
            self.child.end()

    def _read(self) -> None:
        while data := self.child.read():
            self.log.write(data)
            self.on_output(self.name, data)
            lines = [line for line in (self._last_line + data).splitlines(keepends=True) if line.strip()]
            self._last_line = lines[-1][-MAX_LINE:] if lines else b""

    def _bury(self, status: int, now: float) -> None:
        """The process is gone: its descendants go too, and what comes next is decided."""
        self.child.end()
        self._read()
        self.child.close()
        lived_s, was_stopped = now - self.started_at, self._kill_at is not None
        self.cpu_s, self.max_rss_mb = self.cpu_s + self.child.cpu_s, max(self.max_rss_mb, self.child.max_rss_mb)
        self.last_death = Death(status, self._fate or describe_exit(status), self.last_words)
        launch, self.child, self._running, self.usage = self._running, None, None, Usage()
        if was_stopped or self.wanted != launch:
            self.state = states.WAITING if self.wanted else states.STOPPED
            return
        self.num_deaths += 1
        self._deaths = 1 if lived_s > STABLE_AFTER_S else self._deaths + 1
        if self._is_worth_another_try(status):
            self.state = states.BACKING_OFF
            self._due_at = now + min(LONGEST_BACK_OFF_S, FIRST_BACK_OFF_S * 2 ** min(self._deaths - 1, 10))
        else:
            self.state = states.ENDED if status == 0 and not self._fate else states.FAILED
        says_why = status > 0 and not self._fate
        self.reason = self.last_death.how + (f": {self.last_death.last_words}" if says_why else "")

    def _is_worth_another_try(self, status: int) -> bool:
        mode = self.wanted.options.auto_respawn
        was_killed = status < 0 or bool(self._fate)
        if mode == "always":
            return was_killed or status != 2
        if self._deaths > MAX_DEATHS_IN_A_ROW:
            how = f"died {self._deaths} times in a row, the last time it {self.last_death.how}"
            self.last_death = replace(self.last_death, how=how)
            return False
        return (mode == "failure" and (was_killed or status not in (0, 2))) or (mode == "killed" and was_killed)

    def kill(self) -> None:
        if self.child is not None:
            self.child.end()
