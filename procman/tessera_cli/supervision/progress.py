"""What the bus has told about a run so far: the state of each stage, and how far the poses are."""

import statistics
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from tessera_cli.constants import FRAME_RATE_WINDOW_S, MAX_SCALE_SIGMA
from tessera_cli.messages import pose_t, stage_status_t

STARTING, RUNNING = stage_status_t.STARTING, stage_status_t.RUNNING
FINISHED, FAILED = stage_status_t.FINISHED, stage_status_t.FAILED
STAGE_STATES = {STARTING: "starting", RUNNING: "running", FINISHED: "finished", FAILED: "failed"}
TRACKING_STATES = {pose_t.INITIALIZING: "initializing", pose_t.TRACKED: "tracked", pose_t.LOST: "lost"}
# Without a pose for less than this, the camera is looked for where it was (tracker.max_lost_s).
SEARCH_S = 1.5
# Of the path that is kept for a picture: when there are more points, every second one goes.
MAX_PATH_POINTS = 1000


@dataclass
class StageReport:
    """The last STATUS of one stage."""

    name: str
    host: str
    pid: int
    epoch_us: int  # when it started, since 1970
    state: int
    dropped: int
    repaired: int
    lost: int
    undecodable: int
    strangers: int
    queue: int
    step_ms: float  # median
    cpu_percent: float
    rss_mb: float
    last_error: str
    values: dict[str, float]
    received_at: float  # monotonic seconds

    @property
    def num_errors(self) -> int:
        return self.lost + self.undecodable


def to_report(message: stage_status_t) -> StageReport:
    return StageReport(
        name=message.name,
        host=message.host,
        pid=message.pid,
        epoch_us=message.stage_epoch_us,
        state=message.state,
        dropped=message.num_dropped,
        repaired=message.num_repaired,
        lost=message.num_lost,
        undecodable=message.num_undecodable,
        strangers=message.num_strangers,
        queue=message.queue,
        step_ms=message.step_median_ms,
        cpu_percent=message.cpu_percent,
        rss_mb=message.rss_mb,
        last_error=message.last_error,
        values=dict(zip(message.value_names, message.values)),
        received_at=time.monotonic(),
    )


def is_tracker_pose(pose: pose_t) -> bool:
    return pose.header.publisher == "tracker" and pose.state in TRACKING_STATES


def format_duration(seconds: float | None) -> str:
    """Minutes and seconds, such as 1:05."""
    if seconds is None:
        return "-:--"
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


def _state_of(pose: pose_t) -> str:
    if pose.state == pose_t.LOST and 0 <= pose.since_tracked < 1e6 * SEARCH_S:
        return "searching"
    return TRACKING_STATES[pose.state]


@dataclass
class Progress:
    """Of one run."""

    num_frames: int | None = None  # that the source will send, where known
    num_poses: int = 0
    last_frame: int = -1
    tracking_state: str = ""
    started_at: float = field(default_factory=time.monotonic)
    last_pose_at: float | None = None  # monotonic seconds
    stages: dict[str, StageReport] = field(default_factory=dict)
    path: list[tuple[float, float]] = field(default_factory=list)  # from above: right and ahead, units of the map
    _path_step: int = 1  # poses from one of its points to the next
    _recent_latency_ms: deque[tuple[float, float]] = field(default_factory=deque)  # (monotonic seconds, ms)
    _recent: deque[tuple[float, int]] = field(default_factory=deque)  # (monotonic seconds, number of poses)

    def add_report(self, report: StageReport) -> None:
        self.stages[report.name] = report
        if report.name == "camera" and report.values.get("num_frames", 0) > 0:
            self.num_frames = int(report.values["num_frames"])

    def add_pose(self, pose: pose_t) -> None:
        """One that was published before, by a tracker that has been started again, counts once."""
        if pose.frame <= self.last_frame:
            return
        now = time.monotonic()
        self.num_poses += 1
        self.last_frame = max(self.last_frame, pose.frame)
        self.tracking_state = _state_of(pose)
        if pose.state == pose_t.TRACKED and pose.scale_sigma > MAX_SCALE_SIGMA:
            self.tracking_state = "scale in doubt"
        self.last_pose_at = now
        self._recent.append((now, self.num_poses))
        while self._recent[0][0] < now - FRAME_RATE_WINDOW_S:
            self._recent.popleft()
        self._recent_latency_ms.append((now, pose.latency / 1000))
        while self._recent_latency_ms[0][0] < now - FRAME_RATE_WINDOW_S:
            self._recent_latency_ms.popleft()
        if pose.state == pose_t.TRACKED and self.num_poses % self._path_step == 0:
            self._add_to_path(pose.world_from_camera.translation)

    def _add_to_path(self, position: Sequence[float]) -> None:
        self.path.append((position[0], position[2]))
        if len(self.path) > MAX_PATH_POINTS:
            self.path = self.path[::2]
            self._path_step *= 2

    @property
    def state(self) -> str:
        """Of tracking, unless there is nothing to track."""
        if self.catching_up:
            name, share = self.catching_up
            return f"{name} was started again and has done {share:.0%} of its work again"
        if self.silent_s > 0:
            return f"camera silent for {self.silent_s:.0f} s"
        return self.tracking_state or "no pose yet"

    @property
    def catching_up(self) -> tuple[str, float] | None:
        """The stage that was started again and is farthest from where it was, and the share of its journal that it has
        been through. What it says anew, others have already."""
        shares = [
            (stage.values.get("journal_replayed", 1.0), stage.name)
            for stage in self.stages.values()
            if stage.state == RUNNING
        ]
        share, name = min(shares, default=(1.0, ""))
        return (name, share) if share < 1.0 else None

    @property
    def silent_s(self) -> float:
        """How long a live source has sent nothing; 0: it sends."""
        return self._of_dispatcher("silent_s")

    @property
    def gave_up(self) -> bool:
        return self._of_dispatcher("gave_up") > 0

    def _of_dispatcher(self, name: str) -> float:
        return self.stages["dispatcher"].values.get(name, 0.0) if "dispatcher" in self.stages else 0.0

    @property
    def latency_ms(self) -> float | None:
        """From a frame's capture to its pose, the median of the last seconds."""
        return statistics.median(ms for _, ms in self._recent_latency_ms) if self._recent_latency_ms else None

    @property
    def latency_text(self) -> str:
        return f"{self.latency_ms:.0f} ms" if self.latency_ms is not None else "-"

    @property
    def dropped_text(self) -> str:
        """ "3 of 200", or "0"."""
        return f"{self.num_dropped} of {self.num_poses + self.num_dropped}" if self.num_dropped else "0"

    @property
    def frames_per_s(self) -> float:
        if len(self._recent) < 2:
            return 0.0
        (first_at, first_count), (last_at, last_count) = self._recent[0], self._recent[-1]
        return (last_count - first_count) / max(last_at - first_at, 1e-6)

    @property
    def time_left_s(self) -> float | None:
        if self.num_frames is None or self.frames_per_s <= 0:
            return None
        return max(0, self.num_frames - self.num_done) / self.frames_per_s

    @property
    def num_done(self) -> int:
        """Frames with a pose; once the evaluator has all of them, also those whose poses this listener has missed."""
        return self.num_frames if self.is_evaluated and self.num_frames else self.num_poses

    @property
    def of_all_frames(self) -> str:
        """Continues the number of a frame: " of 801", empty if the number of frames is unknown."""
        return f" of {self.num_frames}" if self.num_frames else ""

    @property
    def num_keyframes(self) -> int:
        """In the map, as last reported by the mapper."""
        return self._of_map("keyframes")

    @property
    def num_landmarks(self) -> int:
        return self._of_map("landmarks")

    @property
    def num_loops(self) -> int:
        return self._of_map("loops")

    def _of_map(self, name: str) -> int:
        return int(self.stages["mapper"].values.get(name, 0)) if "mapper" in self.stages else 0

    @property
    def num_dropped(self) -> int:
        return sum(stage.dropped for stage in self.stages.values())

    @property
    def is_evaluated(self) -> bool:
        """The evaluator has received the end of the stream and written its files."""
        return "evaluator" in self.stages and self.stages["evaluator"].state == FINISHED

    @property
    def is_finished(self) -> bool:
        """The occupancy stage has written its files too, if there is one."""
        occupancy = self.stages.get("occupancy")
        return self.is_evaluated and (occupancy is None or occupancy.state == FINISHED)
