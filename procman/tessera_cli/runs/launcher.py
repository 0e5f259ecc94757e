"""tessera run and replay: starts the stack, watches it to the end of the source, and writes its summary.

What the stack consists of, the order in which it starts and what is restarted is defined by procman/local.pmd.
"""

import hashlib
import shutil
import time
from argparse import Namespace
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from tessera_cli.cluster.keys import key_folder
from tessera_cli.console import say
from tessera_cli.constants import (
    DEFAULT_PORT,
    DRAIN_TIMEOUT_S,
    LISTEN_S,
    LOADED_MAP,
    START_TIMEOUT_S,
)
from tessera_cli.errors import RunError, UserError
from tessera_cli.files import PROCMAN
from tessera_cli.interrupt import Interrupt
from tessera_cli.membership import RunDir, draw_secret, pool_secret, secret_of
from tessera_cli.runs.live_view import RunView, make_run_view
from tessera_cli.runs.locks import RunLock
from tessera_cli.runs.ports import PortLock, take_free_port
from tessera_cli.runs.run_folder import (
    Result,
    choose_folder,
    keep_loaded_map,
    leave_journals,
    remove_earlier_run,
    remove_journals,
    require_no_run,
)
from tessera_cli.runs.run_settings import loaded_map, run_assignments, saved_map
from tessera_cli.runs.sources import Source, parse_source
from tessera_cli.runs.summary import (
    Present,
    ProcessFacts,
    RunFacts,
    is_trustworthy,
    occupancy_warnings,
    recording_warnings,
    why_nothing_was_located,
    write_summary,
)
from tessera_cli.settings import Settings, write_settings
from tessera_cli.supervision.private_deputy import PrivateDeputy
from tessera_cli.supervision.process_list import Process, read_process_list
from tessera_cli.supervision.silence import SilenceWatch
from tessera_cli.supervision.stack_monitor import StackMonitor, hear_heartbeats, is_of_this_machine
from tessera_cli.supervision.stall_watch import StallWatch
from tessera_cli.supervision.state_folder import LogFolder
from tessera_cli.versions import tessera_version

PROCESS_LIST = PROCMAN / "local.pmd"
BUSY_BUS = "another stack runs on this bus: end it, or give --port N to keep the two apart."
# Stages whose long steps, or journals when they were killed, frames may have to wait for.
MAP_STAGES = ("tracker", "mapper", "loop_closer", "global_adjuster")


def run_stack(arguments: Namespace, present: Present) -> int:
    """`arguments`: those of `tessera run`. Returns the exit status; `present` says what is printed at the end."""
    source = parse_source(arguments.source)
    folder = choose_folder(arguments.out, source)
    is_new = not folder.exists()
    locks = [_lock_saved_map(arguments), _choose_port(arguments, source)]
    launcher: Launcher | None = None
    cleanup = ExitStack()
    try:
        launcher = _make_launcher(arguments, source, folder, present, cleanup)
        return launcher.run()
    except (UserError, KeyboardInterrupt):
        # Arguments or input were at fault from the beginning: the sentence says all, and nothing is to be kept.
        if is_new and (launcher is None or not launcher.has_poses):
            shutil.rmtree(folder, ignore_errors=True)
        raise
    except RunError:
        if is_new and launcher is None:  # no process was started whose log would tell more
            shutil.rmtree(folder, ignore_errors=True)
        raise
    finally:
        cleanup.close()
        del locks


def _lock_saved_map(arguments: Namespace) -> RunLock | None:
    """Two runs that save one map would each lose what the other has learned."""
    if not (path := saved_map(arguments)):
        return None
    try:
        return RunLock(f"map-{hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:40]}")
    except OSError as error:
        raise UserError(
            f"the map {path} is kept by another run: end that one first, or begin with the map by --load-map "
            "and save another."
        ) from error


def _choose_port(arguments: Namespace, source: Source) -> PortLock | None:
    """Without --port, the first that is free. What another program publishes on (bus:, a pool) it must be told."""
    is_given = arguments.port is not None or any(text.startswith("bus.") for text in arguments.settings)
    if is_given or not source.has_camera_process or arguments.extractors == 0:
        arguments.port = arguments.port or DEFAULT_PORT
        return None
    arguments.port, lock = take_free_port(arguments.prefix)
    if arguments.port != DEFAULT_PORT:
        say(
            f"another stack uses port {DEFAULT_PORT}; this run takes --port {arguments.port}, "
            "which spy and map need to be given."
        )
    return lock


def _make_launcher(
    arguments: Namespace, source: Source, folder: Path, present: Present, cleanup: ExitStack
) -> "Launcher":
    """`cleanup`: gets what is to be done when the run is over."""
    process_list = read_process_list(PROCESS_LIST, _counts(arguments, source))
    assignments = process_list.settings + run_assignments(arguments, source, folder)
    logs = LogFolder(folder / "stages", f"another run writes into {folder}: give another --out DIR.")
    if not arguments.force:
        require_no_run(folder)
    assignments += _keep_loaded_map(arguments, folder)
    remove_earlier_run(folder)
    values = write_settings(assignments, folder / "settings.yaml")
    remove_journals(values)
    cleanup.callback(leave_journals, values)
    if run_dir := _take_bus(arguments, source, values):
        cleanup.callback(run_dir.end)
    processes = [_without_journal(process, values) for process in process_list.processes.values()]
    deputy = PrivateDeputy(logs, folder / "settings.yaml", processes)
    return Launcher(arguments, source, folder, values, deputy, present)


def _keep_loaded_map(arguments: Namespace, folder: Path) -> list[str]:
    """Raises UserError if it can't be kept."""
    if not (path := loaded_map(arguments)):
        (folder / LOADED_MAP).unlink(missing_ok=True)
        return []
    try:
        return [f"mapper.load_map={keep_loaded_map(path, folder)}"]
    except OSError as error:
        raise UserError(f"the map {path} can't be copied into {folder}: {error.strerror}.") from error


def _without_journal(process: Process, values: Settings) -> Process:
    """These can't continue without one, and nobody can replace them."""
    if process.command not in ("tracker", "recorder") or values["stream"]["journal_dir"]:
        return process
    return replace(process, options=replace(process.options, auto_respawn="never"))


def _take_bus(arguments: Namespace, source: Source, values: Settings) -> RunDir | None:
    """The folder of the run, with its secret. Raises UserError if another stack of this machine uses the bus."""
    bus = values["bus"]
    run_dir = RunDir(Path(bus["run_dir"])) if bus["run_dir"] else None
    if run_dir:
        run_dir.lock(BUSY_BUS)
    shares_extractors = arguments.extractors == 0
    for heartbeat in hear_heartbeats(bus["main_url"], bus["channel_prefix"]) if source.has_camera_process else []:
        is_of_pool = shares_extractors and heartbeat.header.publisher.startswith("extractor")
        if is_of_this_machine(heartbeat) and not is_of_pool:
            raise UserError(BUSY_BUS)
    if run_dir:
        run_dir.make(pool_secret(key_folder()) if shares_extractors else draw_secret())
    return run_dir


def _counts(arguments: Namespace, source: Source) -> dict[str, int]:
    """The number of processes of those commands for which it depends on the run."""
    return {
        "extractor": arguments.extractors,
        "recorder": int(arguments.record),
        "occupancy": int(arguments.occupancy),
        "camera": int(source.has_camera_process),
    }


class Launcher:
    """One run."""

    def __init__(
        self,
        arguments: Namespace,
        source: Source,
        folder: Path,
        values: Settings,
        deputy: PrivateDeputy,
        present: Present,
    ) -> None:
        self._arguments = arguments
        self._source = source
        self._folder = folder
        self._deputy = deputy
        self._present = present
        bus = values["bus"]
        self._monitor = StackMonitor(bus["main_url"], bus["channel_prefix"], deputy.owns, secret_of(values))
        self._interrupt = Interrupt()
        self._num_warnings_shown = 0
        self._silence = SilenceWatch(lambda name: deputy.is_busy([name]))
        self._stall = StallWatch()

    def run(self) -> int:
        """The exit status. All processes have ended when it returns or raises."""
        arguments = self._arguments
        extractors = "1 extractor" if arguments.extractors == 1 else f"{arguments.extractors} extractors"
        tiles = "whole images" if arguments.tiles == "1x1" else f"{arguments.tiles} tiles"
        stack = f"{arguments.sensor}, {extractors}, {tiles}"
        title = f"version {tessera_version()}: {self._source.name}, {stack}"
        ended = "complete"
        began = time.monotonic()
        try:
            with make_run_view(title) as view:
                self._start(view)
                began = time.monotonic()
                ended = self._watch(view)
                self._stop()
        except (RunError, UserError) as failure:
            self._stop()
            sentence = self._with_given_map(str(failure))
            if isinstance(failure, RunError) or self.has_poses:
                self._try_to_summarize(self._wall_s(began), sentence)
            raise type(failure)(sentence) from failure
        finally:
            self._deputy.kill()
        result = self._summarize(self._wall_s(began), ended)
        print(self._present(result, self._folder))
        if not result.summary["frames_tracked"]:
            raise RunError(why_nothing_was_located(result.summary, self._arguments.localize_only))
        # A live source has no end of its own: to interrupt it is the ordinary way.
        said = result.summary["ended"]
        ended_well = said == "complete" or (said == "interrupted" and self._source.is_live)
        return 0 if ended_well and is_trustworthy(result.summary) else 1

    def _with_given_map(self, sentence: str) -> str:
        """Stages know the map that was loaded by its name in the run's folder; people by the one that they gave."""
        given = loaded_map(self._arguments)
        return sentence.replace(str(self._folder / LOADED_MAP), str(given)) if given else sentence

    @property
    def has_poses(self) -> bool:
        return self._monitor.progress.num_poses > 0

    def _wall_s(self, began: float) -> float:
        """From the camera's start to the last pose."""
        last_pose_at = self._monitor.progress.last_pose_at
        return max(0.0, last_pose_at - began) if last_pose_at else 0.0

    def _start(self, view: RunView) -> None:
        """Returns when all are ready except the camera, which has just been started: it depends on all others."""
        self._deputy.start()
        deadline = time.monotonic() + START_TIMEOUT_S
        while waiting := [name for name in self._deputy.not_ready if name != "camera"]:
            if self._interrupt.requested:
                return
            if time.monotonic() > deadline:
                raise RunError(
                    f"{', '.join(waiting)} did not report within {START_TIMEOUT_S:.0f} s; "
                    f"the logs are in {self._folder / 'stages'}."
                )
            self._look(view)
        if not self._source.has_camera_process:
            view.say("waiting for frames on the bus; Ctrl-C ends the run")

    def _stop(self) -> None:
        """The recorder goes first: the others still send it what it lacks."""
        self._deputy.stop(["recorder"])
        self._deputy.stop()

    def _watch(self, view: RunView) -> str:
        """Until the files of the run are written. Returns how the run ended, as `RunFacts.ended` has it."""
        progress = self._monitor.progress
        is_told = False
        while not progress.is_finished or "recorder" in self._deputy.not_ready:
            self._look(view)
            if progress.is_evaluated and "occupancy" in progress.stages and not is_told:
                view.say("all frames are done; the occupancy map is being completed")
                is_told = True
            view.update(progress)
            if self._interrupt.requested:
                return self._drain(view)
            if not progress.is_evaluated:
                self._check_stall()
        if progress.gave_up:
            return f"the source sent no image for {self._arguments.give_up:g} s and was given up (--give-up)"
        return "complete"

    def _drain(self, view: RunView) -> str:
        """Ends the source, and waits for the frames that are already in the pipeline."""
        view.say("ending the run")
        self._deputy.request_stop(["camera"])
        deadline = time.monotonic() + DRAIN_TIMEOUT_S
        while not self._monitor.progress.is_finished and time.monotonic() < deadline:
            self._look(view)
        if self._monitor.progress.num_poses == 0:
            raise RunError("interrupted before the first pose.")
        return "interrupted"

    def _look(self, view: RunView) -> None:
        self._monitor.listen(LISTEN_S)
        self._deputy.on_stage_reports(self._monitor.progress.stages.values())
        self._deputy.step()
        if ended := self._deputy.ended:
            last_line = self._deputy.last_line(ended[0])
            raise RunError(f"{ended[0]} ended before the run did; the last line of its log: {last_line}")
        for warning in self._deputy.warnings[self._num_warnings_shown :]:
            view.say(warning)
        self._num_warnings_shown = len(self._deputy.warnings)
        for sentence in self._silence.step(self._monitor.progress.stages.values(), time.monotonic()):
            view.say(sentence)

    def _check_stall(self) -> None:
        progress = self._monitor.progress
        now = time.monotonic()
        stuck_s = self._stall.stuck_s(progress, self._deputy.is_busy(MAP_STAGES), now)
        if self._source.is_live or stuck_s is None:
            return
        errors = [f"{report.name}: {report.last_error}" for report in progress.stages.values() if report.last_error]
        hint = errors[-1] if errors else f"the logs are in {self._folder / 'stages'}."
        raise RunError(f"no pose for {stuck_s:.0f} s after {progress.num_poses} frames; {hint}")

    def _summarize(self, wall_s: float, ended: str) -> Result:
        reports, processes = self._monitor.progress.stages.values(), self._deputy.processes
        occupancy = self._monitor.progress.stages.get("occupancy")
        run_facts = RunFacts(
            source=self._source.text or "bus:",
            sensor=self._arguments.sensor,
            extractors=self._arguments.extractors,
            tiles=self._arguments.tiles,
            wall_s=wall_s,
            ended=ended,
            messages_undecodable=sum(report.undecodable for report in reports),
            messages_of_strangers=self._monitor.num_strangers + sum(report.strangers for report in reports),
            not_written=self._missing_recording(),
        )
        process_facts = ProcessFacts(
            cpu_s={process.name: process.cpu_s for process in processes},
            max_rss_mb={process.name: process.max_rss_mb for process in processes},
            num_extractor_restarts=self._deputy.num_restarts("extractor"),
            warnings=self._deputy.warnings
            + self._silence.warnings
            + self._missing_frames()
            + occupancy_warnings(occupancy)
            + recording_warnings(self._monitor.progress.stages.get("recorder")),
            later_values={occupancy.name: occupancy.values} if occupancy else {},
        )
        return write_summary(self._folder, run_facts, process_facts)

    def _missing_frames(self) -> list[str]:
        """What the camera says of a log that lacks messages."""
        report = self._monitor.progress.stages.get("camera")
        return [report.last_error] if report and self._source.kind == "log" and report.last_error else []

    def _missing_recording(self) -> tuple[str, ...]:
        """A sentence if the run was to be recorded and the log is not whole."""
        if not self._arguments.record or (self._folder / "run.lcmlog").is_file():
            return ()
        report = self._monitor.progress.stages.get("recorder")
        return ("the recording is not whole" + (f": {report.last_error}" if report and report.last_error else ""),)

    def _try_to_summarize(self, wall_s: float, sentence: str) -> None:
        """After a failure: of what there is, if there is anything."""
        try:
            result = self._summarize(wall_s, sentence)
            self._present(result, self._folder)
        except RunError:
            return
        if num_tracked := result.summary["frames_tracked"]:
            say(f"what was reached, {num_tracked} tracked frames, is in {self._folder}")
