"""The message types that the build generates from lcmtypes/, and how their bytes are decoded."""

import io
import struct
import sys
from functools import cache
from typing import Any

from tessera_cli.files import BUILD
from tessera_cli.text import visible, visible_lines

sys.path.insert(0, str(BUILD / "lcmtypes" / "python"))

import tessera

message_types: Any = tessera


def __getattr__(name: str) -> Any:
    """A message type of the build: `from tessera_cli.messages import pose_t`.

    Raises AttributeError, which is ImportError there, if the build, perhaps of an older commit, has none of this name.
    """
    if name.endswith("_t"):
        return getattr(message_types, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


# Every message begins with what tells its type.
FINGERPRINT_BYTES, MAX_HEADER_BYTES = 8, 1000

# What no member of a run has signed. (Arrays of bytes that LCM generates are empty at first: none can be encoded.)
UNSIGNED = bytes(16)
_make_header = message_types.header_t.__init__


def _make_unsigned_header(header: Any) -> None:
    _make_header(header)
    if "tag" in header.__slots__:  # not in builds of old commits
        header.tag = UNSIGNED


message_types.header_t.__init__ = _make_unsigned_header

# What generated code raises on bytes that are no such message.
_DECODE_ERRORS = (ValueError, struct.error, MemoryError, IndexError, OverflowError, TypeError)


def decode(message_type: Any, data: bytes) -> Any | None:
    """The message, or None if the bytes are not a valid one of this type."""
    try:
        return message_type.decode(data)
    except _DECODE_ERRORS:
        return None


def receive(message_type: Any, data: bytes) -> Any | None:
    """As `decode`; what others wrote into its texts may be printed."""
    message = decode(message_type, data)
    if message is not None:
        _make_visible(message)
    return message


def receive_as(type_name: str, data: bytes) -> Any | None:
    """As `receive`, of the type of this name; None also if the build, of another commit, has no such type."""
    message_type = getattr(message_types, type_name, None)
    return receive(message_type, data) if message_type else None


@cache
def _types_by_fingerprint() -> dict[bytes, Any]:
    types: list[Any] = [value for name, value in vars(message_types).items() if name.endswith("_t")]
    return {value._get_packed_fingerprint(): value for value in types if hasattr(value, "_get_packed_fingerprint")}


def type_name_of(data: bytes) -> str | None:
    """The type of a message; None: it is none of ours."""
    message_type = _types_by_fingerprint().get(data[:FINGERPRINT_BYTES])
    return message_type.__name__ if message_type else None


def receive_logged(data: bytes) -> Any | None:
    """As `receive`, of whatever type of ours it is."""
    message_type = _types_by_fingerprint().get(data[:FINGERPRINT_BYTES])
    return receive(message_type, data) if message_type else None


def header_of(data: bytes) -> Any | None:
    """The header of a message of ours, without the rest, which may be an image; None: it has none."""
    message_type = _types_by_fingerprint().get(data[:FINGERPRINT_BYTES])
    if message_type is None or message_type.__slots__[0] != "header":
        return None
    try:
        header = message_types.header_t._decode_one(
            io.BytesIO(data[FINGERPRINT_BYTES : FINGERPRINT_BYTES + MAX_HEADER_BYTES])
        )
    except _DECODE_ERRORS:
        return None
    _make_visible(header)
    return header


def _make_visible(message: Any) -> None:
    """All texts of the message and of the messages in it; only output of processes has lines."""
    for name in message.__slots__:
        value = getattr(message, name)
        if isinstance(value, str):
            has_lines = isinstance(message, message_types.procman_output_t) and name == "text"
            setattr(message, name, visible_lines(value) if has_lines else visible(value))
        elif isinstance(value, list) and value and isinstance(value[0], str):
            setattr(message, name, [visible(text) for text in value])
        else:
            for part in value if isinstance(value, list) else [value]:
                if not hasattr(part, "__slots__"):
                    break
                _make_visible(part)


def type_of(data: bytes) -> Any | None:
    """The type of message that these bytes begin like; None: none of this version."""
    return _types_by_fingerprint().get(data[:FINGERPRINT_BYTES])
