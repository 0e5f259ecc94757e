"""Ctrl-C, SIGTERM and SIGHUP: the first one ends a command in order, the second one at once."""

import signal
from types import FrameType


class Interrupt:
    """Handles the signals of this process from its construction on."""

    def __init__(self) -> None:
        self.requested = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._on_signal)

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True
