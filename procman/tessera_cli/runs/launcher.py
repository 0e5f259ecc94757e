"""tessera run and replay: starts the stack, watches it to the end of the source, and writes the summary.

What the stack consists of, what waits for what and what is started again is said by procman/local.pmd.
"""

import datetime
import time
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path

from tessera_cli import settings
from tessera_cli.errors import RunFailed, UserError
from tessera_cli.files import ROOT
from tessera_cli.interrupt import Interrupt
from tessera_cli.runs.live_view import make_view
from tessera_cli.runs.sources import Source, parse_source
from tessera_cli.supervision.private_deputy import PrivateDeputy
from tessera_cli.supervision.process_list import read_process_list
from tessera_cli.supervision.stack_monitor import BusListener
from tessera_cli.supervision.state_folder import LogFolder

PROCESS_LIST = ROOT / "procman" / "local.pmd"

# A process that has not said by then that it runs never will; LCM's own self-test may take 10 s.
START_TIMEOUT_S = 20.0
# A stored source without a new pose for this long is stuck, unless somebody works on the map: repairs and late tiles take
# a few seconds, but the adjustment of a large map, which frames may wait for and the end does, takes minutes.
STALL_TIMEOUT_S = 120.0
ADJUSTMENT_TIMEOUT_S = 900.0
MAP_STAGES = ("mapper", "loop_closer", "global_adjuster")
# After Ctrl-C the frames on their way get this long to be tracked.
DRAIN_TIMEOUT_S = 3.0
LISTEN_MS = 50
# What a run leaves in its folder; those of an earlier run in the same folder must not be taken for this one's.
RUN_FILES = (
    "summary.json",
    "run.json",
    "report.html",
    "trajectory.png",
    "trajectory.txt",
    "trajectory_live.txt",
    "trajectory_kitti.txt",
    "keyframes.txt",
    "map.ply",
    "map.tessera",
    "ground_truth.txt",
    "frames.csv",
    "loops.csv",
    "run.lcmlog",
    "settings.yaml",
)


def main(arguments: Namespace, tell: Callable[[dict, Path], str] | None = None) -> int:
    """`tell`: the words of a summary and its run's folder that are printed at the end, others than the usual ones."""
    source = parse_source(arguments.source_prefix + arguments.source)
    folder = _choose_folder(arguments.out, source)
    logs = LogFolder(folder / "stages", f"another run writes into {folder}: give another --out DIR.")
    _remove_earlier_run(folder)
    process_list = read_process_list(PROCESS_LIST, _counts(arguments, source))
    assignments = process_list.settings + settings.run_assignments(arguments, source, folder)
    values = settings.write_settings(assignments, folder / "settings.yaml")
    deputy = PrivateDeputy(logs, folder / "settings.yaml", process_list.processes.values())
    return Launcher(arguments, source, folder, values, deputy, tell).run()


def _counts(arguments: Namespace, source: Source) -> dict[str, int]:
    """How many processes of the list's commands this run has, where that depends on it."""
    return {
        "extractor": arguments.extractors,
        "recorder": int(arguments.record),
        "camera": int(source.has_camera_process),
    }


def _choose_folder(out: str | None, source: Source) -> Path:
    now = datetime.datetime.now().strftime("%Y-%m-%d-%H%M%S")
    return Path(out).expanduser().absolute() if out else ROOT / "logs" / f"{now}-{source.name}"


def _remove_earlier_run(folder: Path) -> None:
    for name in RUN_FILES:
        (folder / name).unlink(missing_ok=True)
    for log in (folder / "stages").glob("*.log*"):
        log.unlink()


class Launcher:
    def __init__(
        self,
        arguments: Namespace,
        source: Source,
        folder: Path,
        values: dict,
        deputy: PrivateDeputy,
        tell: Callable[[dict, Path], str] | None,
    ) -> None:
        self._arguments = arguments
        self._tell = tell
        self._source = source
        self._folder = folder
        self._deputy = deputy
        self._bus = BusListener(
            values["bus"]["main_url"],
            values["bus"]["channel_prefix"],
            deputy.owns,
            shares_extractors=arguments.extractors == 0,
        )
        self._interrupt = Interrupt()
        self._num_warnings_said = 0
        self._map_busy_at = 0.0  # monotonic seconds

    def run(self) -> int:
        """The exit status. All processes have ended when it returns or raises."""
        title = f"{self._source.name}, {self._arguments.sensor}, {self._arguments.extractors} extractors, {self._arguments.tiles} tiles"
        ended = "complete"
        began = time.monotonic()
        try:
            with make_view(title) as view:
                self._start(view)
                began = time.monotonic()
                ended = self._watch(view)
                self._stop()
        except RunFailed as failure:
            self._stop()
            self._try_to_summarize(self._wall_s(began), str(failure))
            raise
        finally:
            self._deputy.kill()
        self._print_summary(self._wall_s(began), ended)
        return 0 if ended == "complete" or self._source.is_live else 1

    def _wall_s(self, began: float) -> float:
        """From the camera's start to the last pose."""
        last_pose_at = self._bus.progress.last_pose_at
        return max(0.0, last_pose_at - began) if last_pose_at else 0.0

    def _start(self, view) -> None:
        """Returns when all are ready but the camera, which has been started then: it depends on all others."""
        if self._source.has_camera_process and not self._bus.is_free():
            raise UserError("another stack runs on this bus: end it, or give --port N to keep the two apart.")
        self._deputy.start()
        deadline = time.monotonic() + START_TIMEOUT_S
        while waiting := [name for name in self._deputy.not_ready if name != "camera"]:
            if self._interrupt.requested:
                return
            if time.monotonic() > deadline:
                raise RunFailed(
                    f"{', '.join(waiting)} did not say within {START_TIMEOUT_S:.0f} s that it runs; "
                    f"its log is in {self._folder / 'stages'}."
                )
            self._look(view)
        if not self._source.has_camera_process:
            view.say("waiting for frames on the bus; Ctrl-C ends the run")

    def _stop(self) -> None:
        """The recorder goes first: the others still send it what it lacks."""
        self._deputy.end(["recorder"])
        self._deputy.end()

    def _watch(self, view) -> str:
        """Until the evaluator has everything. Returns how the run ended: "complete" or "interrupted"."""
        progress = self._bus.progress
        while not progress.is_finished:
            self._look(view)
            view.update(progress)
            if self._interrupt.requested:
                return self._drain(view)
            self._check_stall()
        return "complete"

    def _drain(self, view) -> str:
        """Ends the source and lets the frames on their way arrive."""
        view.say("ending the run")
        self._deputy.dismiss(["camera"])
        deadline = time.monotonic() + DRAIN_TIMEOUT_S
        while not self._bus.progress.is_finished and time.monotonic() < deadline:
            self._look(view)
        if self._bus.progress.num_poses == 0:
            raise RunFailed("interrupted before the first pose.")
        return "interrupted"

    def _look(self, view) -> None:
        self._bus.listen(LISTEN_MS)
        self._deputy.hear(self._bus.progress.stages.values())
        self._deputy.step()
        if ended := self._deputy.ended:
            raise RunFailed(
                f"{ended[0]} ended before the run did; the last line of its log: {self._deputy.last_words(ended[0])}"
            )
        if foreign := self._bus.foreign:
            raise UserError(
                f"another stack runs on this bus ({foreign}): end it, or give --port N to keep the two apart."
            )
        for warning in self._deputy.warnings[self._num_warnings_said :]:
            view.say(warning)
        self._num_warnings_said = len(self._deputy.warnings)

    def _check_stall(self) -> None:
        progress = self._bus.progress
        now = time.monotonic()
        if self._deputy.is_busy(MAP_STAGES):
            self._map_busy_at = now
        waited_s = now - max(progress.last_pose_at or 0.0, progress.started_at)
        idle_s = min(waited_s, now - self._map_busy_at)
        if self._source.is_live or (idle_s < STALL_TIMEOUT_S and waited_s < ADJUSTMENT_TIMEOUT_S):
            return
        errors = [f"{report.name}: {report.last_error}" for report in progress.stages.values() if report.last_error]
        raise RunFailed(
            f"no pose for {waited_s:.0f} s after {progress.num_poses} frames; "
            + (errors[-1] if errors else f"the logs are in {self._folder / 'stages'}.")
        )

    def _summarize(self, wall_s: float, ended: str) -> dict:
        from tessera_cli.runs.summary import RunFacts, summarize

        undecodable = sum(report.undecodable for report in self._bus.progress.stages.values())
        facts = RunFacts(
            source=self._source.text or "bus:",
            sensor=self._arguments.sensor,
            extractors=self._arguments.extractors,
            tiles=self._arguments.tiles,
            wall_s=wall_s,
            ended=ended,
            messages_undecodable=undecodable,
        )
        return summarize(self._folder, facts, self._deputy)

    def _print_summary(self, wall_s: float, ended: str) -> None:
        from tessera_cli.runs.summary import in_words

        print((self._tell or in_words)(self._summarize(wall_s, ended), self._folder))

    def _try_to_summarize(self, wall_s: float, sentence: str) -> None:
        """After a failure: what there is, if there is anything."""
        try:
            self._summarize(wall_s, sentence)
        except RunFailed:
            pass
