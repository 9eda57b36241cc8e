"""Bodies for the ingest: right ones, and right ones with something done to them."""

from __future__ import annotations

import gzip
import json
from typing import Any

import msgpack
from hypothesis import strategies as st

Sent = tuple[bytes, dict[str, str]]
"""A body and its headers."""

_numbers = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.integers(-(2**70), 2**70),
    st.sampled_from([0, -0.0, 5e-324, 1.7e308, 2**53, 2**63, -1]),
)
_leaves = st.one_of(
    st.none(), st.booleans(), _numbers, st.text(max_size=8), st.sampled_from(["inf", "-inf", "NaN"])
)
_anything = st.recursive(
    _leaves,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=8), inner, max_size=4)
    ),
    max_leaves=12,
)
_fields = [
    *("seq", "session", "stamp", "angle_min", "angle_max", "angle_increment", "range_min"),
    *("range_max", "ranges", "time_increment", "scan_time", "odometry", "scans", "unknown"),
]


@st.composite
def scans(draw: st.DrawFn) -> dict[str, Any]:
    """A scan; in most of them some field is wrong, missing or of another kind."""
    count = draw(st.integers(1, 6))
    scan: dict[str, Any] = {
        "seq": draw(st.integers(0, 40)),
        "session": draw(st.sampled_from(["0", "1"])),
        "stamp": draw(st.floats(0, 1e6)),
        "angle_min": -1.0,
        "angle_increment": draw(st.sampled_from([0.1, -0.1])),
        "range_min": 0.1,
        "range_max": 30.0,
        "ranges": draw(
            st.lists(st.one_of(st.floats(0, 40), st.none(), st.just("inf")), min_size=count)
        ),
    }
    for field in draw(st.lists(st.sampled_from(_fields), max_size=2)):
        if draw(st.booleans()):
            scan[field] = draw(_anything)
        else:
            scan.pop(field, None)
    return scan


@st.composite
def bodies(draw: st.DrawFn) -> Sent:
    """What arrives: JSON or msgpack, maybe compressed, maybe with broken bytes or headers."""
    value = draw(
        st.one_of(
            scans(), st.fixed_dictionaries({"scans": st.lists(scans(), max_size=5)}), _anything
        )
    )
    as_json = draw(st.booleans())
    data = json.dumps(value).encode() if as_json else _packed(value)
    if draw(st.integers(0, 5)) == 0:
        data = _broken(draw, data)
    headers = {"Content-Type": "application/json" if as_json else "application/msgpack"}
    if draw(st.integers(0, 3)) == 0:
        data = gzip.compress(data, mtime=0)
        headers["Content-Encoding"] = "gzip"
        if draw(st.integers(0, 3)) == 0:
            data = _broken(draw, data)
    if draw(st.integers(0, 15)) == 0:
        headers["Content-Type"] = draw(
            st.sampled_from(["", "text/plain", "application/json; x", "*"])
        )
    return data, headers


def _packed(value: Any) -> bytes:
    try:
        packed: bytes = msgpack.packb(value)
    except (OverflowError, ValueError):  # an integer that msgpack has no room for
        return b"\xc1"
    return packed


def _broken(draw: st.DrawFn, data: bytes) -> bytes:
    at = draw(st.integers(0, max(0, len(data) - 1)))
    how = draw(st.sampled_from(["cut", "flip", "insert", "double"]))
    if how == "cut":
        return data[:at]
    if how == "flip":
        return data[:at] + bytes([draw(st.integers(0, 255))]) + data[at + 1 :]
    if how == "insert":
        return data[:at] + draw(st.binary(min_size=1, max_size=5)) + data[at:]
    return data + data[at:]
