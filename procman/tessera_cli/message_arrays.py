"""Decodes messages with many items fast: arrays become numpy arrays, arrays of structs structured ones.

The generated decoders make one Python object for each item, which takes minutes for a map. What stands where follows
from the same description that lcm-gen leaves in its classes: fields in order, big-endian, arrays without padding.
"""

import functools
import importlib
import math
import struct
from typing import Any

import numpy as np

from tessera_cli.messages import FINGERPRINT_BYTES

# LCM's primitive types but string, as numpy calls them.
_PRIMITIVES: dict[str, np.dtype] = {
    "int8_t": np.dtype(">i1"),
    "int16_t": np.dtype(">i2"),
    "int32_t": np.dtype(">i4"),
    "int64_t": np.dtype(">i8"),
    "float": np.dtype(">f4"),
    "double": np.dtype(">f8"),
    "byte": np.dtype("u1"),
    "boolean": np.dtype("?"),
}


def decode_arrays(message_type: Any, data: bytes) -> Any | None:
    """As `messages.decode`, but arrays of numbers and of structs of fixed size are read-only numpy arrays."""
    if data[:FINGERPRINT_BYTES] != message_type._get_packed_fingerprint():
        return None
    try:
        message, end = _read(message_type, data, FINGERPRINT_BYTES)
    except (ValueError, struct.error, IndexError, UnicodeDecodeError):
        return None
    return message if end == len(data) else None


def _read(message_type: Any, data: bytes, at: int) -> tuple[Any, int]:
    """The struct that begins at byte `at`, and where it ends."""
    message = message_type()
    for name, type_name, dimensions in _fields_of(message_type):
        if dimensions is None:
            value, at = _read_one(type_name, data, at)
        else:
            shape = tuple(size if isinstance(size, int) else getattr(message, size) for size in dimensions)
            value, at = _read_array(type_name, shape, data, at)
        setattr(message, name, value)
    return message, at


def _fields_of(message_type: Any) -> list[tuple[str, str, list[int | str] | None]]:
    return list(zip(message_type.__slots__, message_type.__typenames__, message_type.__dimensions__))


def _read_one(type_name: str, data: bytes, at: int) -> tuple[Any, int]:
    if type_name in _PRIMITIVES:
        dtype = _PRIMITIVES[type_name]
        return np.frombuffer(data, dtype, 1, at)[0].item(), at + dtype.itemsize
    if type_name == "string":
        (length,) = struct.unpack_from(">I", data, at)  # with the zero at its end
        end = at + 4 + length
        if length < 1 or end > len(data):
            raise ValueError("a string leaves the message")
        return data[at + 4 : end - 1].decode(errors="replace"), end
    return _read(_struct_type(type_name), data, at)


def _read_array(type_name: str, shape: tuple[int, ...], data: bytes, at: int) -> tuple[Any, int]:
    """A numpy array; a list of structs that are not all of one size."""
    if min(shape) < 0:
        raise ValueError("an array of negative length")
    dtype = _dtype_of(type_name)
    if dtype is not None:
        if 0 in shape:
            return np.empty(shape, dtype), at
        array = np.frombuffer(data, dtype, math.prod(shape), at).reshape(shape)
        return array, at + array.nbytes
    items = []
    for _ in range(shape[0]):
        item, at = _read_one(type_name, data, at)
        items.append(item)
    return items, at


@functools.cache
def _struct_type(type_name: str) -> Any:
    """Of a name such as tessera.rect_t."""
    package, _, name = type_name.rpartition(".")
    return getattr(importlib.import_module(package), name)


@functools.cache
def _dtype_of(type_name: str) -> np.dtype | None:
    """None if values of the type differ in size."""
    if type_name in _PRIMITIVES:
        return _PRIMITIVES[type_name]
    if type_name == "string":
        return None
    columns = []
    for name, field_type, dimensions in _fields_of(_struct_type(type_name)):
        dtype = _dtype_of(field_type)
        if dtype is None or not all(isinstance(size, int) for size in dimensions or ()):
            return None
        columns.append((name, dtype, tuple(dimensions or ())))
    return np.dtype(columns)
