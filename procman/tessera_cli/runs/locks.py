"""What only one run of this machine may have at a time."""

import socket


class RunLock:
    """Held by a run as long as it lives; the kernel frees it, however the run ends.

    An address without a file, which only processes of this machine (and network namespace) see.
    """

    def __init__(self, name: str) -> None:
        """`name`: at most 90 bytes. Raises OSError if another run holds it."""
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            self._socket.bind(f"\0tessera-{name}")
        except OSError:
            self._socket.close()
            raise
