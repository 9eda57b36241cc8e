"""Logs of tinySLAM (Steux and El Hamzaoui 2010): a Hokuyo URG-04LX, 682 beams a row.

    stamp_us encoder encoder … r_1 … r_682 [mm]

The ranges begin at column 24, or at column 13 in the oldest log; the beams sweep from -120 to +120
degrees. Values under 20 are the sensor's error codes. Wheel encoders are not read: the logs do not
tell the wheels' size.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lineloom_core.io.log_scan import LogError, LogScan
from lineloom_core.scan import InvalidScanError, Scan

BEAMS = 682
_FIRST = math.radians(-120.0)
_STEP = math.radians(240.0) / (BEAMS - 1)
_RANGE_MAX_M = 5.6
_RANGE_MIN_M = 0.02
_STARTS = {13 + BEAMS: 13, 24 + BEAMS: 24, 25 + BEAMS: 24}
"""Numbers in a row, and in which column the ranges begin."""


def read_log(path: str | Path, *, session: str = "0") -> Iterator[LogScan]:
    """Yield the scans in file order, `seq` counting from 0.

    A last row that the recording cut short is left out. Raises LogError, OSError.
    """
    source = Path(path)
    with source.open(encoding="ascii", errors="replace") as file:
        rows = [row.split() for row in file]
    for index, words in enumerate(rows):
        if not words or (index == len(rows) - 1 and len(words) < min(_STARTS)):
            continue
        try:
            yield LogScan(_scan(words, index, session), index + 1)
        except (InvalidScanError, ValueError) as error:
            raise LogError(source, index + 1, str(error)) from None


def _scan(words: list[str], seq: int, session: str) -> Scan:
    if len(words) not in _STARTS:
        known = ", ".join(str(n) for n in _STARTS)
        raise ValueError(f"{len(words)} numbers in a row; tinySLAM's logs have {known}")
    start = _STARTS[len(words)]
    ranges = np.array([float(word) for word in words[start : start + BEAMS]]) / 1000.0
    ranges[ranges < _RANGE_MIN_M] = np.nan
    return Scan.checked(
        ranges,
        angle_min=_FIRST,
        angle_increment=_STEP,
        range_min=_RANGE_MIN_M,
        range_max=_RANGE_MAX_M,
        stamp=float(words[0]) * 1e-6,
        seq=seq,
        session=session,
    )
