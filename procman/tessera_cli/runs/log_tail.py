"""How far a log is that another process is still writing."""

import struct
from pathlib import Path
from typing import BinaryIO

from tessera_cli.messages import camera_image_t

# Before each event of an LCM log: sync word, number, time in us, lengths of the channel and of the data.
HEADER = struct.Struct(">IqqII")
SYNC = 0xEDA1DA01


class LogTail:
    """Continues where the last call stopped. An event that is not complete waits for the next call."""

    def __init__(self, path: Path, channel: str) -> None:
        self._path = path
        self._channel = channel.encode()
        self._position = 0
        self._num_frames = 0

    def num_frames(self) -> int:
        """Of which at least a part is in the log. 0 while there is no log."""
        if not self._path.exists():
            return 0
        newest = b""
        with open(self._path, "rb") as log:
            size = log.seek(0, 2)
            while (event := self._next(log, size)) is not None:
                newest = event or newest
        if newest:
            self._num_frames = camera_image_t.decode(newest).frame + 1
        return self._num_frames

    def _next(self, log: BinaryIO, size: int) -> bytes | None:
        """The data of the next event if it is on the channel, empty if it is on another one; None at the end."""
        log.seek(self._position)
        head = log.read(HEADER.size)
        if len(head) < HEADER.size:
            return None
        sync, _, _, channel_length, data_length = HEADER.unpack(head)
        end = self._position + HEADER.size + channel_length + data_length
        if sync != SYNC or end > size:
            return None
        self._position = end
        return log.read(data_length) if log.read(channel_length) == self._channel else b""
