"""A script that runs a whole stack: watched meanwhile, and summed up as `tessera run` does when its evaluator has finished."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

from tessera_cli import settings
from tessera_cli.messages import procman_process_t, procman_status_t
from tessera_cli.supervision.list_monitor import ListView
from tessera_cli.supervision.sheriff import Sheriff


@dataclass
class Life:
    """Of a process from one start to its end, as deputies told of it last."""

    deputy: str
    command: str
    cpu_s: float = 0.0
    max_rss_mb: float = 0.0
    reason: str = ""


class ScriptRun:
    def __init__(self, sheriff: Sheriff, name: str, assignments: list[str], values: dict) -> None:
        """`values`: the settings that `assignments` make."""
        self._name, self._assignments, self._values = name, assignments, values
        self._view = ListView(values["bus"]["main_url"], values["bus"]["channel_prefix"])
        self._lives: dict[tuple[str, int], Life] = {}  # by process and number of its start
        self._earlier: dict[str, int] = {}  # number of starts before this run
        self._camera_at: float | None = None
        self._evaluator: procman_status_t | None = None  # of its deputy, when it had finished
        sheriff.also_listen_to([self._view.bus])
        sheriff.on_status(self._on_status)

    def _on_status(self, status: procman_status_t) -> None:
        for process in [process for each in status.lists if each.name == self._name for process in each.processes]:
            self._earlier.setdefault(process.name, process.num_starts - bool(process.pid))
            if not process.pid:
                continue
            life = self._lives.setdefault((process.name, process.num_starts), Life(status.deputy, process.command))
            life.cpu_s, life.max_rss_mb = max(life.cpu_s, process.cpu_s), max(life.max_rss_mb, process.rss_mb)
            life.reason = process.reason
            if process.command == "camera" and self._camera_at is None:
                self._camera_at = time.monotonic() - process.up_s
            if process.command == "evaluator" and process.state == procman_process_t.FINISHED:
                self._evaluator = status

    def sum_up(self) -> str:
        """Writes settings.yaml, summary.json, trajectory.png and report.html into the run's folder if it is on this machine.

        Returns what to tell: the result, or how to get it; empty if no evaluator has finished.
        """
        folder = self._values["evaluator"]["out_dir"]
        if self._evaluator is None or not folder:
            return ""
        if self._evaluator.host != os.uname().nodename:
            return (
                f"the run is in {folder} on {self._evaluator.host}; there, procman/tessera evaluate {folder} --report FILE.html "
                "makes a report of it"
            )
        from tessera_cli.runs.summary import in_words, write_summary

        settings.write_settings(self._assignments, Path(folder) / "settings.yaml")
        return in_words(write_summary(Path(folder), self._run_facts(Path(folder)), self._process_facts()), Path(folder))

    def _run_facts(self, folder: Path):
        from tessera_cli.runs.summary import RunFacts

        return RunFacts(
            source=self._values["camera"]["source"],
            sensor=self._values["camera"]["sensor"],
            tiles=self._values["dispatcher"]["tiles"],
            extractors=len({name for (name, _), life in self._lives.items() if life.command == "extractor"}),
            wall_s=self._wall_s(folder),
            ended="complete",
            messages_undecodable=sum(status.num_undecodable for status in self._view.statuses.values()),
        )

    def _wall_s(self, folder: Path) -> float:
        """From the camera's start to the last pose; of a run that had all its poses before the script began, between its poses."""
        import numpy as np

        from tessera_cli.runs.run_folder import read_frames

        if (last_pose_at := self._view.progress.last_pose_at) and self._camera_at:
            return max(0.0, last_pose_at - self._camera_at)
        frames = read_frames(folder / "frames.csv")
        return float(np.nansum(frames.pose_time_ms)) / 1000 if frames else 0.0

    def _process_facts(self):
        from tessera_cli.runs.summary import ProcessFacts

        cpu_s: dict[str, float] = {}
        max_rss_mb: dict[str, float] = {}
        restarts: list[tuple[str, Life]] = []
        for (name, number), life in sorted(self._lives.items()):
            cpu_s[name] = cpu_s.get(name, 0.0) + life.cpu_s
            max_rss_mb[name] = max(max_rss_mb.get(name, 0.0), life.max_rss_mb)
            if number > self._earlier[name] + 1:
                restarts.append((name, life))
        return ProcessFacts(
            cpu_s,
            max_rss_mb,
            sum(life.command == "extractor" for _, life in restarts),
            [
                f"{name} on {life.deputy} was started again: it {life.reason or 'was asked to'}"
                for name, life in restarts
            ],
        )
