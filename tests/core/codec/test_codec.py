"""Laws of the codec: what is written comes back the same, in the same bytes, and nothing else."""

from __future__ import annotations

import math
import struct
from collections import deque
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from lineloom_core.codec import CodecError, decode, encode, storable
from lineloom_core.geometry import Pose

from tests.core.codec.structures import VALUES, Derived, Leaf, Node, Plain, same


def again(value: Any) -> Any:
    return decode(encode(value), object)


@settings(max_examples=200, deadline=None)
@given(VALUES)
def test_everything_comes_back_the_same_and_in_the_same_bytes(value: object) -> None:
    data = encode(value)
    found = decode(data, object)
    assert same(value, found)
    assert encode(found) == data == encode(value)


@pytest.mark.parametrize("bits", [0x7FF8000000000123, 0xFFF0000000000001, 1 << 63, 1])
def test_floats_keep_their_bits(bits: int) -> None:
    number = struct.unpack("<d", struct.pack("<Q", bits))[0]
    assert struct.pack("<d", again(number)) == struct.pack("<Q", bits)
    array = np.array([bits], dtype=np.uint64).view(np.float64)
    assert again(array).view(np.uint64)[0] == bits


def test_arrays_come_back_as_the_solver_had_them() -> None:
    """Order in memory and the flag of writing decide which machine code works on them."""
    plain = np.arange(6.0).reshape(2, 3)
    frozen = plain.copy()
    frozen.setflags(write=False)
    for array in (plain, np.asfortranarray(plain), plain[:, ::2], plain.T, frozen, plain[:0]):
        found = again(array)
        assert same(np.copy(array, order="K") if array.flags.writeable else array, found)
        assert found.flags.owndata or found.base.flags.owndata
    assert not again(frozen).flags.writeable
    found = again(plain)
    found[0, 0] = 9.0
    assert plain[0, 0] == 0.0


def test_what_was_one_object_is_one_again() -> None:
    array, node = np.zeros(3), Node("x")
    a, b, (c, d) = again((array, array, [Node(1, nodes=(node, node)), node]))
    assert a is b
    assert c.nodes[0] is c.nodes[1] is d


def test_equal_objects_that_were_two_stay_two() -> None:
    a, b, c, d = again((np.zeros(3), np.zeros(3), Node(1), Node(1)))
    assert a is not b
    assert c is not d


def test_values_made_only_to_be_written_are_not_taken_for_each_other() -> None:
    """The address of one that is gone may be the next one's."""
    found = again([Derived(float(i)) for i in range(50)])
    assert [item.whole for item in found] == [float(i) for i in range(50)]


def test_a_plain_class_has_what_it_declares() -> None:
    found = again(Plain())
    assert found._ways == deque([(0.5, Pose.identity())])
    assert found._ways.maxlen == 7
    assert not hasattr(found, "derived")


def test_the_order_of_a_set_does_not_show() -> None:
    names = [f"robot {i}" for i in range(40)]
    backwards = names[::-1]
    assert encode(set(names)) == encode(set(backwards))
    assert encode({1, "a", None, (2, 3)}) == encode({(2, 3), None, "a", 1})


def test_fields_go_by_name_whatever_their_order() -> None:
    leaf = Leaf("n", "a", np.ones(2))
    data = encode(leaf)
    names = [b"name", b"kind", b"numbers", b"pair", b"checks"]
    assert [data.index(name) for name in names] == sorted(data.index(name) for name in names)
    swapped = data.replace(b"\xa4name\xa4kind", b"\xa4kind\xa4name").replace(
        b"\xa1n\xa1a", b"\xa1a\xa1n"
    )
    assert swapped != data
    found = decode(swapped, Leaf)
    assert (found.name, found.kind) == ("n", "a")


def test_what_is_known_outside_is_written_by_its_name() -> None:
    known = Leaf("big", "b", np.zeros(10_000))
    data = encode([known, known, Pose(1.0, 2.0, 3.0)], {Leaf: lambda leaf: leaf.name})
    assert len(data) < 120
    assert decode(data, list, {Leaf: {"big": known}.__getitem__})[:2] == [known, known]
    nothing: dict[str, Leaf] = {}
    for finders in (None, {Leaf: nothing.__getitem__}, {Leaf: lambda name: name}):
        with pytest.raises(CodecError, match=r"test-leaf: "):
            decode(data, list, finders)


class Unknown:
    """Nobody registered it."""


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (Unknown(), r"Unknown is not storable"),
        (Node(1, nodes=(Node(Unknown()),)), r"^test-node\.value: .*Unknown is not storable"),
        ([{"a": Pose(0.0, 0.0, Unknown())}], r"^pose\.theta: "),  # type: ignore[arg-type]
        (Leaf("x", "a", np.array([None])), r"^test-leaf\.numbers: an array of object"),
        (np.zeros(2, dtype=">f8"), r"array of >f8"),
        (np.array(["a"]), r"array of <U1"),
        (1j, r"complex is not storable"),
        (1 << 9000, r"int is not storable"),
        (print, r"is not storable"),
        (Unknown, r"type is not storable"),
    ],
)
def test_what_is_not_registered_is_not_written(value: object, said: str) -> None:
    with pytest.raises(CodecError, match=said):
        encode(value)


def test_what_contains_itself_is_refused_at_one_end() -> None:
    ring: list[object] = []
    ring.append(ring)
    with pytest.raises(CodecError):
        encode(ring)
    node = Node(None)
    node.value = node
    with pytest.raises(CodecError):
        decode(encode(node), Node)


def test_a_name_and_a_class_are_taken_once() -> None:
    for name, cls in (("pose", Unknown), ("another", Pose)):
        with pytest.raises(TypeError, match="registered already"):
            storable(name, x=int)(cls)


def test_the_answer_must_be_what_was_asked_for() -> None:
    assert decode(encode((1, "a")), tuple[int, str]) == (1, "a")
    assert math.isnan(decode(encode(math.nan), float))
    for value, expected in (((1, 2), tuple[int, str]), (1, str), (True, int), ([1], list[str])):
        with pytest.raises(CodecError, match="instead of"):
            decode(encode(value), expected)
