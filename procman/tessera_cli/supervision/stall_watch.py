"""Tells for how long a run with stored images has been stuck."""

from tessera_cli.constants import ADJUSTMENT_TIMEOUT_S, STALL_TIMEOUT_S
from tessera_cli.supervision.progress import Progress


class StallWatch:
    """Frames wait for a stage that works on the map, and for one that was killed until it has done again what it had
    done, which takes the longer the longer the run is. All times are monotonic seconds."""

    def __init__(self) -> None:
        self._map_busy_at = 0.0
        self._caught_up_at = 0.0
        self._catching_up: tuple[str, float] | None = None

    def stuck_s(self, progress: Progress, is_map_busy: bool, now: float) -> float | None:
        """How long there has been neither a pose nor anything to wait for; None: not too long. `is_map_busy`: a stage
        that works on the map uses the processor."""
        if is_map_busy:
            self._map_busy_at = now
        if progress.catching_up != self._catching_up:
            self._catching_up, self._caught_up_at = progress.catching_up, now
        waited_s = now - max(progress.last_pose_at or 0.0, progress.started_at, self._caught_up_at)
        idle_s = min(waited_s, now - self._map_busy_at)
        return waited_s if idle_s >= STALL_TIMEOUT_S or waited_s >= ADJUSTMENT_TIMEOUT_S else None
