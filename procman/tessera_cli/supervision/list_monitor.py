"""Listens to the stages of one process list on their own bus, whichever node they are on."""

from tessera_cli.cluster.keys import key_folder
from tessera_cli.constants import POSE, STATUS
from tessera_cli.lcm_bus import Bus
from tessera_cli.membership import run_dir_of
from tessera_cli.messages import pose_t, stage_status_t
from tessera_cli.supervision.progress import Progress, StageReport, format_duration, is_tracker_pose, to_report


class ListMonitor:
    """Keeps the last report of each stage and the progress of the current run.

    It believes members only if this user has started the list on this machine, or another has left its secret here.
    """

    def __init__(self, main_url: str, channel_prefix: str) -> None:
        secret = run_dir_of(key_folder(), main_url, channel_prefix).secret()
        self.bus = Bus(main_url, "watch")
        self.bus.subscribe(channel_prefix + STATUS, stage_status_t, self._on_status, secret)
        self.bus.subscribe(channel_prefix + POSE, pose_t, self._on_pose, secret)
        self.reports: dict[tuple[str, int], StageReport] = {}  # by name and process
        self.progress = Progress()

    def _on_status(self, status: stage_status_t) -> None:
        report = to_report(status)
        self.reports[report.name, report.pid] = report
        self.progress.add_report(report)

    def _on_pose(self, pose: pose_t) -> None:
        if not is_tracker_pose(pose):
            return
        if pose.frame <= self.progress.last_frame:  # another run has begun
            self.progress = Progress(num_frames=self.progress.num_frames)
        if self.progress.num_poses == 0:
            self.progress.num_poses = pose.frame  # earlier poses, which were published before this began to listen
        self.progress.add_pose(pose)

    def describe(self) -> str:
        """Empty if it has no pose yet."""
        progress = self.progress
        if progress.num_poses == 0:
            return ""
        return (
            f"frame {progress.last_frame + 1}{progress.of_all_frames}, {progress.frames_per_s:.1f}/s, "
            f"{format_duration(progress.time_left_s)} left, {progress.state}, "
            f"latency {progress.latency_text}, dropped {progress.dropped_text}"
        )
