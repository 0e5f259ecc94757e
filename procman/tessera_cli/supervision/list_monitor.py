"""What the stages of one list say on their own bus, whichever node they are on."""

from tessera_cli.lcm_bus import Bus
from tessera_cli.messages import pose_t, stage_status_t
from tessera_cli.runs.live_view import describe_time
from tessera_cli.supervision.progress import Progress

TRACKING_STATES = {pose_t.INITIALIZING: "initializing", pose_t.TRACKED: "tracked", pose_t.LOST: "lost"}


class ListView:
    def __init__(self, main_url: str, channel_prefix: str) -> None:
        self.bus = Bus(main_url, "watch")
        self.bus.subscribe(channel_prefix + "STATUS", stage_status_t, self._on_stage)
        self.bus.subscribe(channel_prefix + "POSE", pose_t, self._on_pose)
        self.statuses: dict[tuple[str, int], stage_status_t] = {}  # by name and process
        self.progress = Progress()

    def _on_stage(self, status: stage_status_t) -> None:
        self.statuses[status.name, status.pid] = status
        values = dict(zip(status.value_names, status.values))
        if status.name == "camera" and values.get("num_frames", 0) > 0:
            self.progress.num_frames = int(values["num_frames"])

    def _on_pose(self, pose: pose_t) -> None:
        if pose.header.publisher == "tracker" and pose.state in TRACKING_STATES:
            if pose.frame <= self.progress.last_frame:  # another run has begun
                self.progress = Progress(num_frames=self.progress.num_frames)
            if self.progress.num_poses == 0:
                self.progress.num_poses = pose.frame  # those before it went by unheard
            self.progress.add_pose(pose.frame, TRACKING_STATES[pose.state])

    def in_words(self) -> str:
        """Empty if it has no pose yet."""
        progress = self.progress
        if progress.num_poses == 0:
            return ""
        of_all = f" of {progress.num_frames}" if progress.num_frames else ""
        return (
            f"frame {progress.last_frame + 1}{of_all}, {progress.frames_per_s:.1f}/s, {describe_time(progress.time_left_s)} left, "
            f"{progress.tracking_state}"
        )
