"""Whatever the bytes say: an object of registered classes, or one clear error; nothing runs."""

from __future__ import annotations

import contextlib
import pickle
import tracemalloc
import zlib
from collections import deque
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lineloom_core.codec import CodecError, decode, encode, inflate, wire
from lineloom_core.geometry import Pose

from tests.core.codec.structures import VALUES, Leaf, Node, Plain


def ext(code: int, data: bytes = b"") -> Any:
    return msgpack.ExtType(code, data)


def message(value: object, *classes: tuple[object, object, object]) -> bytes:
    """A message with a table of one's own."""
    table = ext(wire.TABLE, msgpack.packb(classes))
    return bytes(msgpack.packb([table, value]))


POSE = ("pose", False, ("x", "y", "theta"))
NODE = ("test-node", True, ("value", "leaf", "nodes"))
LEAF = ("test-leaf", False, ("name", "kind", "numbers", "pair", "checks"))
FIRST = ext(wire.OBJECT, b"\0")
ONES = ext(wire.ARRAY, bytes([11, 1, 1, 0, 0, 0]) + np.ones(1).tobytes())


def test_the_forger_of_these_tests_can_write() -> None:
    assert decode(message([FIRST, 1.0, 2.0, 3.0], POSE), Pose) == Pose(1.0, 2.0, 3.0)
    assert decode(message([FIRST, 0, 5, None, [ext(wire.TUPLE)]], NODE), Node).value == 5
    leaf = [FIRST, "n", "a", ONES, [ext(wire.TUPLE), 1, "b"], {"c": 2}]
    assert decode(message(leaf, LEAF), Leaf).pair == (1, "b")


@pytest.mark.parametrize(
    ("forged", "said"),
    [
        (message([FIRST, 1.0, 2.0], POSE), r"pose: 2 fields"),
        (message([FIRST, 1.0, 2.0, 3.0, 4.0], POSE), r"pose: 4 fields"),
        (message([FIRST, 1.0, 2.0, "3"], POSE), r"pose\.theta: is a str"),
        (message([FIRST, 1.0, 2.0, True], POSE), r"pose\.theta: is a bool"),
        (message([FIRST, 1.0, 2.0], ("pose", False, ("x", "y"))), r"pose\.theta: missing"),
        (message(1, ("pose", False, ("x", "y", "theta", "z"))), r"pose\.z: unknown"),
        (message(1, ("pose", False, ("x", "y", "theta", "x"))), r"pose: a field twice"),
        (message(1, ("os.system", False, ())), r"'os\.system': no class"),
        (message(1, ("pose", True, ("x", "y", "theta"))), r"pose: is not shared"),
        (message([FIRST, 0, 5, 6, [ext(wire.TUPLE)]], NODE), r"test-node\.leaf: is a int"),
        (message([FIRST, 0, 5, None, [ext(wire.TUPLE), 7]], NODE), r"test-node\.nodes: holds"),
        (message([FIRST, "x", 5, None, [ext(wire.TUPLE)]], NODE), r"without a number"),
        (message([FIRST, "n", "c", ONES, None, {}], LEAF), r"test-leaf\.kind: holds"),
        (message([FIRST, "n", "a", ONES, None, {1: 2.0}], LEAF), r"test-leaf\.checks: holds"),
        (
            message([FIRST, "n", "a", ext(wire.ARRAY, b"\x08\1\1\0\0\0a"), None, {}], LEAF),
            r"no message|array of shape",
        ),
        (
            message([FIRST, "n", "a", ext(wire.ARRAY, b"\5\1\1\0\0\0a"), None, {}], LEAF),
            r"test-leaf\.numbers: holds",
        ),
        (message(FIRST, POSE), r"not a table and a value"),
        (message([1, FIRST], POSE), r"not a table and a value"),
        (message({FIRST: 1}, POSE), r"not a table and a value"),
        (message(FIRST), r"no message"),
        (message([ext(wire.SAME_ARRAY, b"\0\0\0\0")]), r"no message"),
        (message([ext(wire.SAME_OBJECT, b"\0\0\0\0")]), r"no message"),
        (message([ext(wire.SET), []]), r"no message"),
        (message({(): 1}), r"no message"),
        (message([ext(wire.DEQUE)]), r"no message"),
        (message([ext(wire.DEQUE), -1]), r"no message"),
        (message([ext(wire.OUTSIDE, b"\0"), 1], POSE), r"pose: is named"),
        (message(ext(99)), r"kind 99"),
        (message(ext(wire.TABLE, b"\x90")), r"kind 0"),
        (msgpack.packb([1, 2]), r"not a table and a value"),
        (message(1)[:-1], r"no message"),
        (message(1) + b"\0", r"no message"),
        (b"", r"no message"),
    ],
)
def test_a_forged_message_is_refused_by_class_and_field(forged: bytes, said: str) -> None:
    with pytest.raises(CodecError, match=said):
        decode(forged, object)


@pytest.mark.parametrize(
    "data",
    [
        b"\x0b\1\xff\xff\xff\xff" + bytes(8),
        b"\x0b\3\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff" + bytes(8),
        b"\x0b\xff" + bytes(1020),
        b"\x3f\0" + bytes(8),
        b"\x0b",
        b"",
        b"\0\1\1\0\0\0\2",  # a bool of 2
    ],
)
def test_an_array_is_as_large_as_its_bytes(data: bytes) -> None:
    with pytest.raises(CodecError):
        decode(message(ext(wire.ARRAY, data)), object)


def test_depth_and_announced_sizes_break_nothing() -> None:
    deep = b"\x92" + msgpack.packb(ext(wire.TABLE, b"\x90")) + b"\x91" * 500_000
    wide = b"\xdd\x7f\xff\xff\xff" * 900
    tracemalloc.start()
    for forged in (deep, wide, b"\x92\xc7\x01\x00\x90" + wide, b"\xdf\xff\xff\xff\xff\x01"):
        with pytest.raises(CodecError):
            decode(forged, object)
    assert tracemalloc.get_traced_memory()[1] < 1 << 28
    tracemalloc.stop()


def test_what_inflates_too_far_is_refused() -> None:
    assert inflate(zlib.compress(b"abc"), 3) == b"abc"
    whole = zlib.compress(bytes(1 << 20))
    for data, most in ((whole, 1 << 19), (whole[:-1], 1 << 21), (whole + b"x", 1 << 21), (b"", 9)):
        with pytest.raises(CodecError, match="compressed"):
            inflate(data, most)


class Bomb:
    def __init__(self, path: Path) -> None:
        self._path = path

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return Path.touch, (self._path,)


def test_a_pickle_is_no_message(tmp_path: Path) -> None:
    fuse = tmp_path / "ran"
    for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
        bomb = pickle.dumps(Bomb(fuse), protocol=protocol)
        for forged in (bomb, message(bomb), message(ext(wire.ARRAY, bomb))):
            with contextlib.suppress(CodecError):
                assert decode(forged, object) == bomb  # bytes inside a message are bytes
    assert not fuse.exists()
    pickle.loads(bomb)
    assert fuse.exists(), "the bomb is a dud"


PLAIN = (type(None), bool, int, float, str, bytes, list, tuple, dict, set, frozenset, deque)


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=200))
def test_noise_is_refused_or_plain(data: bytes) -> None:
    for forged in (data, b"\x92" + msgpack.packb(ext(wire.TABLE, b"\x90")) + data):
        try:
            found = decode(forged, object)
        except CodecError:
            continue
        assert isinstance(found, (*PLAIN, np.ndarray, np.generic))


@settings(max_examples=200, deadline=None)
@given(VALUES | st.builds(Plain), st.data())
def test_a_damaged_message_is_refused_or_a_value(value: object, data: st.DataObject) -> None:
    whole = bytearray(encode(value))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(whole) - 1))
        if data.draw(st.booleans()):
            whole[at] = data.draw(st.integers(0, 255))
        else:
            del whole[at : at + data.draw(st.integers(1, 5))]
        if not whole:
            break
    try:
        found = decode(bytes(whole), object)
    except CodecError:
        return
    encode(found)  # it is made of storable things alone
