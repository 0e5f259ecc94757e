"""A message as lines of text: a field each, what lies within it indented, long lists shortened."""

from typing import Any

import numpy as np

from tessera_cli.message_arrays import decode_arrays
from tessera_cli.messages import type_of

INDENT = "  "
# Items of a list that are written out.
MAX_NUMBERS, MAX_STRUCTS = 8, 3


def tree_of(data: bytes) -> list[str]:
    """Of the bytes of any message."""
    message_type = type_of(data)
    message = decode_arrays(message_type, data) if message_type else None
    if message is None:
        return [f"{len(data)} bytes that are no message of this version"]
    return list(_fields(message, ""))


def _fields(struct: Any, indent: str) -> list[str]:
    lines: list[str] = []
    for name in struct.__slots__:
        lines += _field(name, getattr(struct, name), indent)
    return lines


def _field(name: str, value: Any, indent: str) -> list[str]:
    if hasattr(value, "__slots__") and not isinstance(value, str | np.ndarray):
        return [f"{indent}{name}", *_fields(value, indent + INDENT)]
    if isinstance(value, np.ndarray):
        return _array(name, value, indent)
    if isinstance(value, list):
        lines = [f"{indent}{name}: {_count(len(value))}"]
        for index, item in enumerate(value[:MAX_STRUCTS]):
            lines += _field(f"[{index}]", item, indent + INDENT)
        return [*lines, *_rest(len(value), indent)]
    return [f"{indent}{name}: {_number(value)}"]


def _array(name: str, values: np.ndarray, indent: str) -> list[str]:
    if values.dtype.names is None:
        flat = values.reshape(-1)
        shown = " ".join(_number(value) for value in flat[:MAX_NUMBERS].tolist())
        if len(flat) <= MAX_NUMBERS:
            return [f"{indent}{name}: {shown or 'none'}"]
        bounds = f"{_number(flat.min().item())} .. {_number(flat.max().item())}"
        return [f"{indent}{name}: {len(flat)} numbers, {bounds}: {shown} ..."]
    lines = [f"{indent}{name}: {_count(len(values))}"]
    for index, item in enumerate(values[:MAX_STRUCTS]):
        lines.append(f"{indent}{INDENT}[{index}]")
        for column in values.dtype.names:
            within = item[column]
            lines += _field(column, within if within.shape else within.item(), indent + 2 * INDENT)
    return [*lines, *_rest(len(values), indent)]


def _count(number: int) -> str:
    return f"{number} {'item' if number == 1 else 'items'}" if number else "none"


def _rest(number: int, indent: str) -> list[str]:
    return [f"{indent}{INDENT}... {number - MAX_STRUCTS} more"] if number > MAX_STRUCTS else []


def _number(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
