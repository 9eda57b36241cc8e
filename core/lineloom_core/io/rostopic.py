"""What `rostopic echo -p /scan > scans.csv` wrote: LaserScan as CSV, a column for each beam.

%time,field.header.seq,field.header.stamp,…,field.angle_min,…,field.ranges0,field.ranges1,…
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lineloom_core.io.log_scan import LogError, LogScan
from lineloom_core.scan import InvalidScanError, Scan

_BEAM = re.compile(r"field\.ranges_?(\d+)$")
_FIELDS = ("angle_min", "angle_increment", "range_min", "range_max")
_ELSE = (
    "CSV is read as `rostopic echo -p` writes LaserScan; save other tables with numpy as .npz "
    "(core/docs/formats.md)"
)
_OPTIONAL = ("time_increment", "scan_time")


def read_log(path: str | Path, *, session: str = "0") -> Iterator[LogScan]:
    """Yield the scans in file order, `seq` counting from 0. Raises LogError, OSError."""
    source = Path(path)
    with source.open(encoding="utf-8", errors="replace", newline="") as file:
        rows = csv.reader(file)
        header = [name.strip() for name in next(rows, [])]
        column = {name: index for index, name in enumerate(header)}
        beams = [index for name, index in column.items() if _BEAM.match(name)]
        missing = [n for n in _FIELDS if f"field.{n}" not in column] or (
            [] if beams else ["ranges"]
        )
        if missing:
            raise LogError(source, 1, f"no column field.{missing[0]}: {_ELSE}")
        for seq, row in enumerate(row for row in rows if row):
            try:
                yield LogScan(_scan(row, column, beams, seq, session), seq + 2)
            except (InvalidScanError, ValueError, IndexError) as error:
                raise LogError(source, seq + 2, str(error)) from None


def _scan(row: list[str], column: dict[str, int], beams: list[int], seq: int, session: str) -> Scan:
    """Return a row's scan. A sweep with fewer beams than others leaves columns empty."""
    stamp = float(row[column.get("field.header.stamp", column.get("%time", 0))])
    ranges = [float(row[index]) for index in beams if index < len(row) and row[index].strip()]
    numbers: dict[str, Any] = {name: float(row[column[f"field.{name}"]]) for name in _FIELDS}
    for name in _OPTIONAL:
        if f"field.{name}" in column:
            numbers[name] = max(0.0, float(row[column[f"field.{name}"]]))
    # Nanoseconds, as rostopic prints a time.
    seconds = stamp * 1e-9 if stamp > 1e14 else stamp
    return Scan.checked(ranges, stamp=seconds, seq=seq, session=session, **numbers)
