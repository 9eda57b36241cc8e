"""Logs of DP-SLAM (Eliazar and Parr 2003): a half circle of a SICK, without any times.

    Odometry x y theta
    Laser count r_1 … r_n

Metres and radians; beams from -90 to +90 degrees. The n-th scan is given the time n / 5 s, for
nothing but the order of scans is known.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from lineloom_core.geometry import Pose
from lineloom_core.io.carmen import open_text
from lineloom_core.io.log_scan import LogError, LogScan
from lineloom_core.scan import InvalidScanError, Scan

_RANGE_MAX_M = 8.0
_PERIOD_S = 0.2


def read_log(path: str | Path, *, session: str = "0") -> Iterator[LogScan]:
    """Yield the scans in file order, `seq` counting from 0. Raises LogError, OSError."""
    source, odometry, seq = Path(path), None, 0
    with open_text(source) as lines:
        for number, text in enumerate(lines, start=1):
            word, *values = text.split() or [""]
            try:
                if word == "Odometry":
                    odometry = Pose(float(values[0]), float(values[1]), float(values[2]))
                elif word == "Laser":
                    yield LogScan(_scan(values, odometry, seq, session), number)
                    seq, odometry = seq + 1, None
            except (InvalidScanError, ValueError, IndexError) as error:
                raise LogError(source, number, f"{word}: {error}") from None


def _scan(values: list[str], odometry: Pose | None, seq: int, session: str) -> Scan:
    ranges = [float(value) for value in values[1:]]
    if len(ranges) != int(values[0]) or len(ranges) < 2:
        raise ValueError(f"{values[0]} beams are told, {len(ranges)} are there")
    return Scan.checked(
        ranges,
        angle_min=-math.pi / 2.0,
        angle_increment=math.pi / (len(ranges) - 1),
        range_min=0.0,
        range_max=_RANGE_MAX_M,
        stamp=seq * _PERIOD_S,
        seq=seq,
        session=session,
        odometry=odometry,
    )
