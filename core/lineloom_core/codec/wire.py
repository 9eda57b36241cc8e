"""Extension codes and small formats: what of a message is not plain msgpack.

A message is the array [table, value]. The table names the classes that occur, each with the names
of its fields in the order in which they are written; it is read before any of the value is.
A list is a msgpack array, a dict a map with keys of any type. All else is an array that begins
with a tag: an object's fields, a tuple, a set.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec.errors import CodecError

TABLE, ARRAY, SAME_ARRAY, SAME_OBJECT, SCALAR, BIG_INTEGER = range(6)
"""Leaves with data. SAME_: number of an array or a shared object that came before."""

TUPLE, SET, FROZEN_SET, DEQUE, OBJECT, OUTSIDE = range(16, 22)
"""Tags. OBJECT, OUTSIDE: data is the class's number in the table, one byte."""

MOST_CLASSES = 256
MOST_DIMENSIONS = 8
MOST_INTEGER_BYTES = 1024

_NUMBERS = "? <i1 <i2 <i4 <i8 <u1 <u2 <u4 <u8 <f2 <f4 <f8"
_DTYPES = tuple(map(np.dtype, _NUMBERS.split()))
_CODES = {dtype: code for code, dtype in enumerate(_DTYPES)}
_FORTRAN, _READ_ONLY = 0x40, 0x80


def pack_array(array: NDArray[Any]) -> bytes:
    """Return dtype, flags, shape and numbers, bit for bit. Raises CodecError for other dtypes."""
    code = _CODES.get(array.dtype)
    if code is None or array.ndim > MOST_DIMENSIONS:
        raise CodecError(f"an array of {array.dtype} in {array.ndim} dimensions is not storable")
    fortran = array.flags.f_contiguous and not array.flags.c_contiguous
    flags = (_FORTRAN if fortran else 0) | (0 if array.flags.writeable else _READ_ONLY)
    head = bytes((code | flags, array.ndim))
    shape = b"".join(n.to_bytes(4, "little") for n in array.shape)
    return head + shape + array.tobytes("F" if fortran else "C")


def unpack_array(data: bytes) -> NDArray[Any]:
    """Return an array of its own memory. Raises CodecError where shape and bytes do not fit."""
    flags, dimensions = data[:2] if len(data) > 1 else (0x3F, 0)
    code, start = flags & 0x3F, 2 + 4 * dimensions
    if code >= len(_DTYPES) or dimensions > MOST_DIMENSIONS or len(data) < start:
        raise CodecError("an array of no known kind")
    dtype = _DTYPES[code]
    shape = [int.from_bytes(data[i : i + 4], "little") for i in range(2, start, 4)]
    size = dtype.itemsize
    for n in shape:
        size *= n
    if size != len(data) - start:
        raise CodecError(f"an array of shape {shape} and {dtype} has {len(data) - start} bytes")
    if code == 0 and data[start:].translate(None, b"\x00\x01"):
        raise CodecError("an array of bool holds other bytes than 0 and 1")
    # Copied, for the numbers lie anywhere in the message and machine code wants them aligned.
    flat = np.frombuffer(data, dtype, offset=start) if size else np.empty(0, dtype)
    array = np.array(flat).reshape(shape, order="F" if flags & _FORTRAN else "C")
    if flags & _READ_ONLY:
        array.setflags(write=False)
    return array


def unpack_scalar(data: bytes) -> Any:
    """Return a number of numpy's that was written as an array without dimensions."""
    array = unpack_array(data)
    if array.ndim:
        raise CodecError("a number that is an array")
    return array[()]
