"""Log entry bodies: what was accepted, as compact bytes, and back, number for number.

The mapper is only ever fed what `decode_scan` returns, live as in a replay, so the map depends
on nothing but the stored bytes.
"""

from __future__ import annotations

from typing import Any

import msgpack
import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.mapping.belief.claim import Claim
from lineloom_core.mapping.facts.scan_name import ScanName
from lineloom_core.scan import Mount, Scan
from numpy.typing import NDArray

_FORMAT = 1


class CorruptEntryError(ValueError):
    """The bytes of a log entry do not decode."""


def encode_scan(scan: Scan) -> bytes:
    """Return the scan without seq and session, which the log keeps beside it.

    Ranges go as float32 where that loses nothing (every lidar driver speaks float32), as float64
    otherwise (decimals from JSON).
    """
    with np.errstate(over="ignore"):
        single = scan.ranges.astype("<f4")
    exact = bool(np.array_equal(single, scan.ranges, equal_nan=True))
    ranges = single if exact else scan.ranges.astype("<f8", copy=False)
    odometry = scan.odometry
    packed: bytes = msgpack.packb(
        (
            _FORMAT,
            scan.stamp,
            scan.angle_min,
            scan.angle_increment,
            scan.range_min,
            scan.range_max,
            scan.time_increment,
            scan.scan_time,
            None if odometry is None else (odometry.x, odometry.y, odometry.theta),
            4 if exact else 8,
            ranges.tobytes(),
        )
    )
    return packed


def decode_scan(body: bytes, session: str, seq: int) -> Scan:
    """Return the scan that was encoded."""
    fields = _unpack(body, 11)
    ranges: NDArray[np.float64] = np.frombuffer(fields[10], dtype=f"<f{fields[9]}").astype(
        np.float64
    )
    ranges.setflags(write=False)
    return Scan(
        ranges=ranges,
        stamp=fields[1],
        angle_min=fields[2],
        angle_increment=fields[3],
        range_min=fields[4],
        range_max=fields[5],
        time_increment=fields[6],
        scan_time=fields[7],
        odometry=None if fields[8] is None else Pose(*fields[8]),
        session=session,
        seq=seq,
    )


def encode_mount(mount: Mount) -> bytes:
    """Return a mount as bytes; equal mounts give equal bytes."""
    T = mount.T_base_laser
    packed: bytes = msgpack.packb((_FORMAT, T.x, T.y, T.theta, mount.inverted))
    return packed


def decode_mount(body: bytes) -> Mount:
    """Return the mount that was encoded."""
    fields = _unpack(body, 5)
    return Mount(T_base_laser=Pose(fields[1], fields[2], fields[3]), inverted=fields[4])


def encode_claim(claim: Claim) -> bytes:
    """Return what an action is about: the scans that it rests on, and how they were said to lie.

    All that a replay needs to find it again, under whatever parameters and by whatever code.
    """
    T = claim.T_a_b
    ends = [(s.robot, s.session, s.seq, s.repeat) for s in (claim.scan_a, claim.scan_b)]
    packed: bytes = msgpack.packb(
        (_FORMAT, claim.constraint, claim.kind, claim.origin, *ends, (T.x, T.y, T.theta))
    )
    return packed


def decode_claim(body: bytes) -> Claim | str:
    """Return the claim that was encoded; of a former version's log the name that it had by number.

    Those logs hold the name as text, whose letters no list of msgpack begins with.
    """
    if body[:1].isalpha():
        return body.decode()
    _, constraint, kind, origin, a, b, T_a_b = _unpack(body, 7)
    return Claim(constraint, kind, origin, ScanName(*a), ScanName(*b), Pose(*T_a_b))


def _unpack(body: bytes, length: int) -> list[Any]:
    try:
        fields = msgpack.unpackb(body)
    except ValueError as error:
        raise CorruptEntryError(f"log entry is not msgpack: {error}") from error
    if not isinstance(fields, list) or len(fields) != length or fields[0] != _FORMAT:
        raise CorruptEntryError("log entry is of an unknown format")
    return fields
