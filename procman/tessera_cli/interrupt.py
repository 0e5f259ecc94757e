"""Ctrl-C, SIGTERM and SIGHUP end a command in order; a second one at once."""

import signal


class Interrupt:
    def __init__(self) -> None:
        self.requested = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._on_signal)

    def _on_signal(self, _number, _frame) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True
