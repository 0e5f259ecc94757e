"""Watches a script that runs a whole stack on several nodes, and sums it up when its evaluator has finished."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tessera_cli.messages import procman_process_t, procman_status_t
from tessera_cli.runs.run_folder import read_frames
from tessera_cli.runs.summary import Present, ProcessFacts, RunFacts, is_trustworthy, write_summary
from tessera_cli.settings import Settings, write_settings
from tessera_cli.supervision.list_monitor import ListMonitor
from tessera_cli.supervision.sheriff import Sheriff


@dataclass
class ProcessUsage:
    """Of a process from one start to its end, as last reported by its deputy."""

    deputy: str
    command: str
    cpu_s: float = 0.0
    max_rss_mb: float = 0.0
    reason: str = ""


class ScriptWatcher:
    """Listens to deputies and stages while the script is carried out."""

    def __init__(self, sheriff: Sheriff, name: str, assignments: list[str], values: Settings) -> None:
        """`name`: of the list. `values`: the settings that `assignments` make."""
        self._name, self._assignments, self._values = name, assignments, values
        self._monitor = ListMonitor(values["bus"]["main_url"], values["bus"]["channel_prefix"])
        self._usages: dict[tuple[str, int], ProcessUsage] = {}  # by process and number of its start
        self.is_trustworthy = True  # as is_trustworthy() has it, of the run that it has summed up
        self._earlier_starts: dict[str, int] = {}  # before this run
        self.ended = ""  # as in summary.json; empty: nothing was summed up
        self._camera_at: float | None = None  # monotonic seconds
        self._evaluator: procman_status_t | None = None  # of its deputy, when it had finished
        sheriff.also_listen_to([self._monitor.bus])
        sheriff.on_status(self._on_status)

    def _on_status(self, status: procman_status_t) -> None:
        for process in [process for each in status.lists if each.name == self._name for process in each.processes]:
            self._earlier_starts.setdefault(process.name, process.num_starts - bool(process.pid))
            if not process.pid:
                continue
            start = (process.name, process.num_starts)
            usage = self._usages.setdefault(start, ProcessUsage(status.deputy, process.command))
            usage.cpu_s = max(usage.cpu_s, process.cpu_s)
            usage.max_rss_mb = max(usage.max_rss_mb, process.rss_mb)
            usage.reason = process.reason
            is_at_work = process.state != procman_process_t.WAITING
            if process.command == "camera" and is_at_work and self._camera_at is None:
                self._camera_at = time.monotonic() - process.up_s
            if process.command == "evaluator" and process.state == procman_process_t.FINISHED:
                self._evaluator = status

    def sum_up(self, present: Present) -> str:
        """Writes settings.yaml and summary.json, and presents the run, if its folder is on this machine.

        Returns what to print: the result, or how to get it; empty if no evaluator has finished.
        """
        out_dir = self._values["evaluator"]["out_dir"]
        if self._evaluator is None or not out_dir:
            return ""
        if self._evaluator.host != os.uname().nodename:
            return (
                f"the run is in {out_dir} on {self._evaluator.host}; "
                f"to make a report there: procman/tessera evaluate {out_dir} --report FILE.html"
            )
        folder = Path(out_dir)
        write_settings(self._assignments, folder / "settings.yaml")
        result = write_summary(folder, self._run_facts(folder), self._process_facts())
        self.ended = result.summary["ended"]
        words = present(result, folder)
        self.is_trustworthy = is_trustworthy(result.summary)
        return words

    def _run_facts(self, folder: Path) -> RunFacts:
        extractors = {name for (name, _), usage in self._usages.items() if usage.command == "extractor"}
        return RunFacts(
            source=self._values["camera"]["source"],
            sensor=self._values["camera"]["sensor"],
            extractors=len(extractors),
            tiles=self._values["dispatcher"]["tiles"],
            wall_s=self._wall_s(folder),
            ended="complete",
            messages_undecodable=sum(report.undecodable for report in self._monitor.reports.values()),
            messages_of_strangers=sum(report.strangers for report in self._monitor.reports.values()),
        )

    def _wall_s(self, folder: Path) -> float:
        """From the camera's start to the last pose; between the poses if all came before the script began."""
        if (last_pose_at := self._monitor.progress.last_pose_at) and self._camera_at:
            return max(0.0, last_pose_at - self._camera_at)
        frames = read_frames(folder / "frames.csv")
        return float(np.nansum(frames.pose_time_ms)) / 1000 if frames else 0.0

    def _process_facts(self) -> ProcessFacts:
        cpu_s: dict[str, float] = {}
        max_rss_mb: dict[str, float] = {}
        restarts: list[tuple[str, ProcessUsage]] = []
        for (name, number), usage in sorted(self._usages.items(), key=lambda item: item[0]):
            cpu_s[name] = cpu_s.get(name, 0.0) + usage.cpu_s
            max_rss_mb[name] = max(max_rss_mb.get(name, 0.0), usage.max_rss_mb)
            if number > self._earlier_starts[name] + 1:
                restarts.append((name, usage))
        return ProcessFacts(
            cpu_s=cpu_s,
            max_rss_mb=max_rss_mb,
            num_extractor_restarts=sum(usage.command == "extractor" for _, usage in restarts),
            warnings=[
                f"{name} on {usage.deputy} was restarted: it {usage.reason or 'was ordered to restart'}"
                for name, usage in restarts
            ],
        )
