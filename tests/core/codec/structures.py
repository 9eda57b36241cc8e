"""Values of all kinds that are storable, and when two are the same to the last bit."""

from __future__ import annotations

import struct
from collections import deque
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, Literal

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as stn
from lineloom_core.codec import encode, storable
from lineloom_core.geometry import Pose
from numpy.typing import NDArray


@storable("test-leaf")
@dataclass(frozen=True, eq=False, slots=True)
class Leaf:
    name: str
    kind: Literal["a", "b"]
    numbers: NDArray[np.float64]
    pair: tuple[int, str] | None = None
    checks: dict[str, float] = field(default_factory=dict)


@storable("test-node", shared=True)
@dataclass(eq=False)
class Node:
    value: object
    leaf: Leaf | None = None
    nodes: tuple[Node, ...] = ()


@storable("test-plain", _count=int, _ways=deque[tuple[float, Pose]])
class Plain:
    def __init__(self) -> None:
        self._count = 3
        self._ways = deque([(0.5, Pose.identity())], maxlen=7)
        self.derived = "not written"


@storable("test-derived", half=float)
class Derived:
    def __init__(self, whole: float) -> None:
        self.whole = whole

    def __getstate__(self) -> dict[str, Any]:
        return {"half": self.whole / 2}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.whole = 2 * state["half"]


def same(a: Any, b: Any) -> bool:
    """Equal in type and content, floats by their bits, orders of dicts included."""
    if type(a) is not type(b):
        return False
    if isinstance(a, float) and not isinstance(a, np.generic):
        return struct.pack("<d", a) == struct.pack("<d", b)
    if isinstance(a, np.ndarray):
        return _same_arrays(a, b)
    if isinstance(a, np.generic):
        return bool(a.tobytes() == b.tobytes())
    if isinstance(a, set | frozenset):
        return len(a) == len(b) and same(sorted(map(encode, a)), sorted(map(encode, b)))
    if isinstance(a, dict):
        return same([*a.items()], [*b.items()])
    if isinstance(a, deque) and a.maxlen != b.maxlen:
        return False
    if isinstance(a, list | tuple | deque):
        return len(a) == len(b) and all(map(same, a, b))
    if is_dataclass(a):
        return all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, Plain | Derived):
        return {**vars(a), "derived": 0} == {**vars(b), "derived": 0}
    return bool(a == b)


def _same_arrays(a: NDArray[Any], b: NDArray[Any]) -> bool:
    one, other = a.flags, b.flags
    return (
        (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
        and one.writeable == other.writeable
        and (one.f_contiguous and not one.c_contiguous) == (not other.c_contiguous)
        and other.aligned
    )


DTYPES = st.one_of(
    stn.boolean_dtypes(),
    stn.integer_dtypes(endianness="<"),
    stn.unsigned_integer_dtypes(endianness="<"),
    stn.floating_dtypes(endianness="<", sizes=(16, 32, 64)),
)
ARRAYS = stn.arrays(DTYPES, stn.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5))
TEXT = st.text(st.characters(codec=None, exclude_categories=()), max_size=8)
HASHABLE = st.recursive(
    st.one_of(
        st.none(), st.booleans(), st.integers(), st.floats(), TEXT, st.binary(max_size=8),
        st.integers(-(10**200), 10**200),
    ),
    lambda inner: st.tuples(inner, inner) | st.frozensets(inner, max_size=3),
    max_leaves=4,
)  # fmt: skip
POSES = st.builds(Pose, st.floats(), st.floats(), st.floats())
LEAVES = st.builds(
    Leaf,
    TEXT,
    st.sampled_from(["a", "b"]),
    stn.arrays(np.float64, (3, 3)),
    st.none() | st.tuples(st.integers(), TEXT),
    st.dictionaries(TEXT, st.floats(), max_size=3),
)
SCALARS = stn.arrays(DTYPES, ()).map(lambda array: array[()])
VALUES = st.recursive(
    st.one_of(HASHABLE, ARRAYS, SCALARS, POSES, LEAVES, st.builds(Plain)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.lists(inner, max_size=4).map(tuple),
        st.lists(inner, max_size=4).map(lambda items: deque(items, maxlen=len(items) + 1)),
        st.dictionaries(HASHABLE, inner, max_size=4),
        st.sets(HASHABLE, max_size=4),
        st.builds(Node, inner, st.none() | LEAVES),
    ),
    max_leaves=12,
)
