"""JSON lines: one scan a line, spelled as in the HTTP contract.

Besides the contract's fields a line may carry `"robot"` (whose scan it is) and `"truth"`
(`{"x", "y", "theta"}`, the simulator's true pose of the laser), which no server ever sees.
JSON has no infinities: `null` is an invalid range, `"inf"` no return, `"-inf"` too close.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lineloom_core.geometry import Pose
from lineloom_core.scan import InvalidScanError, Scan

_NUMBERS = ("angle_min", "angle_increment", "range_min", "range_max", "stamp")
_OPTIONAL_NUMBERS = ("angle_max", "time_increment", "scan_time")
_KNOWN = {*_NUMBERS, *_OPTIONAL_NUMBERS, "ranges", "seq", "session", "odometry", "robot", "truth"}


class JsonLinesError(ValueError):
    """A line that cannot be read; the message begins with file:line."""

    def __init__(self, path: Path, line: int, reason: str) -> None:
        super().__init__(f"{path}:{line}: {reason}")
        self.path = path
        self.line = line
        self.reason = reason


@dataclass(frozen=True, slots=True)
class ScanRecord:
    """A line: the scan, and optionally whose it is and where it truly was taken."""

    scan: Scan
    robot: str | None = None
    truth: Pose | None = None


def read_jsonl(path: str | Path) -> Iterator[ScanRecord]:
    """Yield the records of a file in file order; blank lines are passed over.

    Raises JsonLinesError on a broken line, OSError where the file cannot be read.
    """
    source = Path(path)
    with source.open(encoding="utf-8", errors="replace") as lines:
        for number, text in enumerate(lines, start=1):
            if text.isspace():
                continue
            try:
                yield record_from_json(json.loads(text))
            except json.JSONDecodeError as error:
                raise JsonLinesError(source, number, f"not JSON: {error}") from None
            except InvalidScanError as error:
                raise JsonLinesError(source, number, str(error)) from None


def write_jsonl(path: str | Path, records: Iterable[ScanRecord]) -> int:
    """Write records, one a line, and return how many; an existing file is replaced."""
    count = 0
    with Path(path).open("w", encoding="utf-8", newline="\n") as out:
        for record in records:
            out.write(json.dumps(record_to_json(record), allow_nan=False, separators=(",", ":")))
            out.write("\n")
            count += 1
    return count


def record_to_json(record: ScanRecord) -> dict[str, Any]:
    """Return the record as JSON's own types; reading it back gives the same numbers."""
    scan = record.scan
    line: dict[str, Any] = {} if record.robot is None else {"robot": record.robot}
    line |= {
        "session": scan.session,
        "seq": scan.seq,
        "stamp": scan.stamp,
        "angle_min": scan.angle_min,
        "angle_increment": scan.angle_increment,
        "range_min": scan.range_min,
        "range_max": scan.range_max,
        "ranges": [_range_to_json(value) for value in scan.ranges.tolist()],
    }
    if scan.time_increment:
        line["time_increment"] = scan.time_increment
    if scan.scan_time:
        line["scan_time"] = scan.scan_time
    if scan.odometry is not None:
        line["odometry"] = _pose_to_json(scan.odometry)
    if record.truth is not None:
        line["truth"] = _pose_to_json(record.truth)
    return line


def record_from_json(line: object) -> ScanRecord:
    """Build a record from one parsed line, or raise InvalidScanError naming the field."""
    if not isinstance(line, Mapping):
        raise InvalidScanError("scan", "must be a JSON object")
    unknown = sorted(str(key) for key in line.keys() - _KNOWN)
    if unknown:
        raise InvalidScanError(unknown[0], "is not a field of a scan")
    numbers = {name: _number(line, name) for name in _NUMBERS}
    numbers |= {name: _number(line, name) for name in _OPTIONAL_NUMBERS if name in line}
    scan = Scan.checked(
        _ranges(line.get("ranges")),
        seq=_seq(line.get("seq", 0)),
        session=_text(line, "session") or "0",
        odometry=_pose(line, "odometry"),
        **numbers,
    )
    return ScanRecord(scan, _text(line, "robot"), _pose(line, "truth"))


def _range_to_json(value: float) -> float | str | None:
    if math.isnan(value):
        return None
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    return value


def _ranges(values: object) -> list[float]:
    if not isinstance(values, list):
        raise InvalidScanError("ranges", "must be a list of numbers")
    ranges = []
    for index, value in enumerate(values):
        if value is None:
            ranges.append(math.nan)
        elif value in ("inf", "-inf"):
            ranges.append(float(value))
        else:
            number = _finite(value)
            if number is None:
                raise InvalidScanError(
                    f"ranges/{index}", 'is neither a finite number, null, "inf" nor "-inf"'
                )
            ranges.append(number)
    return ranges


def _number(line: Mapping[str, Any], name: str) -> float:
    if name not in line:
        raise InvalidScanError(name, "is missing")
    number = _finite(line[name])
    if number is None:
        raise InvalidScanError(name, "must be a finite number")
    return number


def _finite(value: object) -> float | None:
    """Return the number, or None for anything else JSON can hold (a bool is no number)."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _seq(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise InvalidScanError("seq", "must be a whole number")
    return value


def _text(line: Mapping[str, Any], name: str) -> str | None:
    value = line.get(name)
    if value is not None and not isinstance(value, str):
        raise InvalidScanError(name, "must be a string")
    return value


def _pose(line: Mapping[str, Any], name: str) -> Pose | None:
    value = line.get(name)
    if value is None:
        return None
    if not isinstance(value, Mapping):
        raise InvalidScanError(name, 'must be an object {"x", "y", "theta"}')
    try:
        return Pose(_number(value, "x"), _number(value, "y"), _number(value, "theta"))
    except InvalidScanError as error:
        raise InvalidScanError(f"{name}/{error.field}", error.reason) from None


def _pose_to_json(pose: Pose) -> dict[str, float]:
    return {"x": pose.x, "y": pose.y, "theta": pose.theta}
