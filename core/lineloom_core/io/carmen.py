"""CARMEN logs: laser scans from `FLASER` and `ROBOTLASER1` lines.

    FLASER n r_1 … r_n  x y theta  odom_x odom_y odom_theta  stamp host logger_stamp
    ROBOTLASER1 type angle_min fov increment range_max accuracy remission_mode
        n r_1 … r_n  m i_1 … i_m  laser_x laser_y laser_theta  x y theta
        tv rv forward side turn  stamp host logger_stamp

Both lines carry two poses, of the laser and of the robot. A scan's `odometry` is the robot's pose
(FLASER: `odom_*`), since that is the frame the contract gives odometry in. In logs that were
corrected afterwards (fr079) the pose is no odometry any more.

FLASER lines do not say how their beams lie. They come from SICK lidars with a half-turn field of
view, one beam per half or full degree, and an even count lacks the last beam: 181 and 361 beams
end at +90 degrees, 180 and 360 one step before.
"""

from __future__ import annotations

import gzip
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from lineloom_core.geometry import Pose
from lineloom_core.io.log_scan import LogError, LogScan
from lineloom_core.scan import InvalidScanError, Scan

SICK_RANGE_MAX = 81.9
"""A SICK LMS in 80 m mode reports 81.91 where nothing came back."""

_FLASER_SWEEPS = {
    180: math.radians(1.0),
    181: math.radians(1.0),
    360: math.radians(0.5),
    361: math.radians(0.5),
}
_GZIP_MAGIC = b"\x1f\x8b"
_FLASER_TAIL = 9
_ROBOTLASER_HEAD = 7
_ROBOTLASER_TAIL = 14


@dataclass(frozen=True, slots=True)
class FlaserSweep:
    """How the beams of FLASER lines lie, for logs that are not from a half-turn SICK."""

    angle_min: float
    angle_increment: float
    range_max: float = SICK_RANGE_MAX


def read_carmen(
    path: str | Path, *, session: str = "0", flaser: FlaserSweep | None = None
) -> Iterator[Scan]:
    """Yield the scans of a CARMEN log in file order, `seq` counting from 0.

    Ranges of 0 become NaN (unknown), ranges at or above the maximum +inf (no return). Raises
    LogError on a broken line, OSError where the file cannot be read.
    """
    for record in read_log(path, session=session, flaser=flaser):
        yield record.scan


def read_log(
    path: str | Path, *, session: str = "0", flaser: FlaserSweep | None = None
) -> Iterator[LogScan]:
    """Yield the scans with their line numbers."""
    source = Path(path)
    parsers: dict[str, Callable[[list[str]], _Parsed]] = {
        "FLASER": lambda words: _parse_flaser(words, flaser),
        "ROBOTLASER1": _parse_robotlaser,
    }
    kind: str | None = None
    seq = 0
    with open_text(source) as lines:
        for number, text in enumerate(lines, start=1):
            word = text.split(maxsplit=1)[0] if not text.isspace() else ""
            if word not in parsers or (kind is not None and word != kind):
                # Logs of the years between carry every scan as both messages: the kind that
                # comes first is taken, so that no scan is read twice.
                continue
            kind = word
            try:
                parsed = parsers[word](text.split()[1:])
                scan = parsed.to_scan(seq, session)
            except InvalidScanError as error:
                raise LogError(source, number, f"{word}: {error}") from None
            except ValueError as error:
                raise LogError(source, number, f"{word}: {_plain(error)}") from None
            yield LogScan(scan, number)
            seq += 1


def open_text(path: Path) -> IO[str]:
    """Open a log; one that is compressed by gzip is read as it was, whatever its name."""
    with path.open("rb") as file:
        compressed = file.read(2) == _GZIP_MAGIC
    if compressed:
        return gzip.open(path, "rt", encoding="ascii", errors="replace")
    return path.open(encoding="ascii", errors="replace")


@dataclass(frozen=True, slots=True)
class _Parsed:
    ranges: list[float]
    angle_min: float
    angle_increment: float
    range_max: float
    robot: Pose
    stamp: float

    def to_scan(self, seq: int, session: str) -> Scan:
        ranges = np.array(self.ranges)
        ranges[ranges == 0.0] = np.nan
        return Scan.checked(
            ranges,
            angle_min=self.angle_min,
            angle_increment=self.angle_increment,
            range_min=0.0,
            range_max=self.range_max,
            stamp=self.stamp,
            seq=seq,
            session=session,
            odometry=self.robot,
        )


def _parse_flaser(words: list[str], sweep: FlaserSweep | None) -> _Parsed:
    count = _count(words, 0, "ranges")
    _expect(words, 1 + count + _FLASER_TAIL, f"{count} ranges and {_FLASER_TAIL} more values")
    if sweep is None:
        if count not in _FLASER_SWEEPS:
            known = ", ".join(str(n) for n in _FLASER_SWEEPS)
            raise ValueError(
                f"{count} beams: only {known} are known to be a SICK's half turn; "
                "say how the beams lie with FlaserSweep"
            )
        sweep = FlaserSweep(math.radians(-90.0), _FLASER_SWEEPS[count])
    tail = words[1 + count :]
    return _Parsed(
        ranges=[float(word) for word in words[1 : 1 + count]],
        angle_min=sweep.angle_min,
        angle_increment=sweep.angle_increment,
        range_max=sweep.range_max,
        robot=_pose(tail[3:6]),
        stamp=float(tail[6]),
    )


def _parse_robotlaser(words: list[str]) -> _Parsed:
    count = _count(words, _ROBOTLASER_HEAD, "ranges")
    after = _ROBOTLASER_HEAD + 1 + count
    remissions = _count(words, after, "remission values")
    tail_at = after + 1 + remissions
    _expect(
        words,
        tail_at + _ROBOTLASER_TAIL,
        f"{count} ranges, {remissions} remission values and {_ROBOTLASER_TAIL} more values",
    )
    tail = words[tail_at:]
    return _Parsed(
        ranges=[float(word) for word in words[_ROBOTLASER_HEAD + 1 : after]],
        angle_min=float(words[1]),
        angle_increment=float(words[3]),
        range_max=float(words[4]),
        robot=_pose(tail[3:6]),
        stamp=float(tail[11]),
    )


def _pose(words: list[str]) -> Pose:
    return Pose(float(words[0]), float(words[1]), float(words[2]))


def _count(words: list[str], at: int, what: str) -> int:
    if len(words) <= at:
        raise ValueError(f"the line ends before the number of {what}")
    if not words[at].isdigit():
        raise ValueError(f"the number of {what} is {words[at]!r}, not a whole number")
    return int(words[at])


def _expect(words: list[str], expected: int, what: str) -> None:
    if len(words) != expected:
        raise ValueError(
            f"expected {what} ({expected} in all after the keyword), found {len(words)}: "
            "the line is cut off or run together"
        )


def _plain(error: ValueError) -> str:
    """Return float()'s own complaint in the words of a log's reader."""
    text = str(error)
    return text.replace("could not convert string to float:", "not a number:")
