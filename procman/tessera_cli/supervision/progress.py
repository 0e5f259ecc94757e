"""What the bus has told of a run so far: the state of each stage and how far the poses are."""

import time
from collections import deque
from dataclasses import dataclass, field

# The frame rate shown is over the last poses only, so that it follows changes.
RATE_WINDOW_S = 5.0

STARTING, RUNNING, FINISHED, FAILED = range(4)
STATE_NAMES = ("starting", "running", "finished", "failed")


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
    queue: int
    step_ms: float  # median
    cpu_percent: float
    rss_mb: float
    last_error: str
    values: dict[str, float]
    heard_at: float  # monotonic seconds

    @property
    def num_errors(self) -> int:
        return self.lost + self.undecodable


@dataclass
class Progress:
    num_frames: int | None = None  # that the source will send, where known
    num_poses: int = 0
    last_frame: int = -1
    tracking_state: str = ""
    started_at: float = field(default_factory=time.monotonic)
    last_pose_at: float | None = None  # monotonic seconds
    stages: dict[str, StageReport] = field(default_factory=dict)
    _recent: deque = field(default_factory=deque)  # (monotonic seconds, number of poses)

    def add_pose(self, frame: int, state: str) -> None:
        now = time.monotonic()
        self.num_poses += 1
        self.last_frame = max(self.last_frame, frame)
        self.tracking_state = state
        self.last_pose_at = now
        self._recent.append((now, self.num_poses))
        while self._recent[0][0] < now - RATE_WINDOW_S:
            self._recent.popleft()

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
        return max(0, self.num_frames - self.num_poses) / self.frames_per_s

    @property
    def num_keyframes(self) -> int:
        """In the map, as the mapper said last."""
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
    def is_finished(self) -> bool:
        """The evaluator has seen the end of the stream and written its files."""
        return "evaluator" in self.stages and self.stages["evaluator"].state == FINISHED
