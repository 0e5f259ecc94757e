"""All processes of one deputy, and what it knows of those of other deputies that they wait for."""

import time
from collections.abc import Callable
from dataclasses import replace

from tessera_cli.messages import procman_process_t
from tessera_cli.supervision.child_process import Child, Launch
from tessera_cli.supervision.log_file import RotatingLog
from tessera_cli.supervision.process_tree import Trees
from tessera_cli.supervision.state_folder import LogFolder
from tessera_cli.supervision.supervised_process import READY, STATE_NAMES, Supervised

USAGE_PERIOD_S = 1.0
# Deputies speak once a second; one that was not heard for longer may be gone, and its processes with it.
OTHERS_STALE_AFTER_S = 5.0
# Who takes longer between two looks was stopped itself (Ctrl-Z), or kept from running.
LONGEST_TURN_S = 1.0


class Crew:
    def __init__(self, folder: LogFolder, on_output: Callable[[str, bytes], None]) -> None:
        self._folder, self._on_output = folder, on_output
        self._members: dict[str, Supervised] = {}
        self._others: dict[str, tuple[int, float]] = {}  # (state, when heard)
        self._trees = Trees()
        self._usage_at = 0.0
        self._stepped_at: float | None = None
        self._told: dict[str, str] = {}

    @property
    def names(self) -> list[str]:
        return list(self._members)

    @property
    def processes(self) -> list[Supervised]:
        return list(self._members.values())

    @property
    def talkers(self) -> list[Child]:
        """Whose output is worth waiting for."""
        return [member.child for member in self._members.values() if member.child and member.child.may_say_more]

    @property
    def is_idle(self) -> bool:
        return all(member.is_idle for member in self._members.values())

    @property
    def facts(self) -> tuple:
        """What others want to know at once when it changes."""
        return tuple((member.name, member.state, member.reason, member.num_starts) for member in self._members.values())

    def news(self) -> list[str]:
        """A sentence for each process whose state has changed."""
        now = {
            member.name: f"{member.name} is {STATE_NAMES[member.state]}"
            + (f": {member.reason}" if member.reason else "")
            for member in self._members.values()
        }
        changed = [sentence for name, sentence in now.items() if self._told.get(name) != sentence]
        self._told = now
        return changed

    def generations(self, run: str) -> dict[str, int]:
        return {
            name: member.wanted.generation
            for name, member in self._members.items()
            if member.wanted and member.wanted.run == run
        }

    def want(self, launches: dict[str, Launch], session: str, of: str = "") -> None:
        """Of those whose names begin with `of` exactly these; the others are ended. Those that ended before are forgotten."""
        for name in [
            name
            for name, member in self._members.items()
            if name.startswith(of) and member.is_idle and name not in launches
        ]:
            self._members.pop(name).log.close()
        for name in [name for name in launches if name not in self._members]:
            log = RotatingLog(self._folder.log_path(name))
            self._members[name] = Supervised(name, self._folder.mark(name), log, self._on_output)
        for name, member in self._members.items():
            if name.startswith(of):
                member.want(launches.get(name), session)

    def restart(self, name: str, generation: int) -> None:
        member = self._members[name]
        if member.wanted:
            member.want(replace(member.wanted, generation=generation), member.session)

    def tail(self, name: str, num_lines: int) -> str:
        return self._members[name].log.tail(num_lines)

    def on_stage_status(self, name: str, pid: int, is_finished: bool, heard_at: float) -> None:
        member = self._members.get(name)
        if member and member.child and pid in {member.child.pid, *member.usage.pids}:
            member.on_stage_status(is_finished, heard_at)

    def hear_of_others(self, states: dict[str, int], now: float) -> None:
        """States of another deputy's processes by name."""
        for name, state in states.items():
            if name not in self._members:
                self._others[name] = (state, now)

    def forget_others(self, of: str) -> None:
        """Those whose names begin with `of`."""
        self._others = {name: heard for name, heard in self._others.items() if not name.startswith(of)}

    def step(self, now: float) -> None:
        """`now`: monotonic seconds, as everywhere here."""
        if self._stepped_at is not None and now - self._stepped_at > LONGEST_TURN_S:
            for member in self._members.values():
                member.excuse(now - self._stepped_at, now)
        self._stepped_at = now
        if now - self._usage_at >= USAGE_PERIOD_S:
            self._usage_at = now
            self._measure(now)
        # What has done its last work needs nobody any more.
        needed = {
            name
            for member in self._members.values()
            if member.child and member.state != procman_process_t.FINISHED
            for name in member.depends
        }
        for member in self._members.values():
            member.step(now, self._is_not_ready, member.name in needed)

    def _measure(self, now: float) -> None:
        roots = [member.child.pid for member in self._members.values() if member.child]
        usages = self._trees.snapshot(roots, now) if roots else {}
        for member in self._members.values():
            if member.child and member.child.pid in usages:
                member.usage = usages[member.child.pid]

    def _is_not_ready(self, name: str) -> bool:
        if member := self._members.get(name):
            return member.state not in READY
        state, heard_at = self._others.get(name, (procman_process_t.STOPPED, 0.0))
        return state not in READY or time.monotonic() - heard_at > OTHERS_STALE_AFTER_S
