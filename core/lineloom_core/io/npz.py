"""Arrays of numpy: `np.savez(path, ranges=…, stamps=…, angle_min=…, angle_increment=…, …)`.

ranges: (n, beams) [m], NaN invalid, inf no return; stamps: (n,) [s]; angle_min, angle_increment
[rad] and range_max [m] are numbers. Optional: range_min [m], odometry (n, 3) x, y, theta [m, rad],
a row of NaN where there is none. `scans`, `t` and `odom` are other names of ranges, stamps and
odometry; there a range of 0 is invalid.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.io.log_scan import LogError, LogScan
from lineloom_core.scan import InvalidScanError, Scan

_NAMES = {"ranges": "scans", "stamps": "t", "odometry": "odom"}
_NUMBERS = ("angle_min", "angle_increment", "range_max")


def read_log(path: str | Path, *, session: str = "0") -> Iterator[LogScan]:
    """Yield the scans row by row, `seq` counting from 0. Raises LogError, OSError."""
    source = Path(path)
    try:
        with np.load(source, allow_pickle=False) as file:
            arrays = {name: np.asarray(file[name]) for name in file.files}
        ranges, stamps, odometry = _checked(arrays)
        limits = {name: float(arrays[name]) for name in _NUMBERS}
        limits["range_min"] = float(arrays.get("range_min", 0.0))
    except (ValueError, TypeError, zipfile.BadZipFile) as error:
        raise LogError(source, 0, str(error)) from None
    for row, (beams, stamp) in enumerate(zip(ranges, stamps, strict=True)):
        pose = None if odometry is None or not np.isfinite(odometry[row]).all() else odometry[row]
        try:
            scan = Scan.checked(
                beams,
                stamp=float(stamp),
                seq=row,
                session=session,
                odometry=None if pose is None else Pose(*map(float, pose)),
                **limits,
            )
        except InvalidScanError as error:
            raise LogError(source, row + 1, str(error)) from None
        yield LogScan(scan, row + 1)


def _checked(
    arrays: Mapping[str, NDArray[np.generic]],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None]:
    """Return ranges, stamps and odometry. Raises ValueError, naming what is missing or amiss."""
    found = {name: arrays.get(name, arrays.get(other)) for name, other in _NAMES.items()}
    missing = [name for name in ("ranges", "stamps") if found[name] is None]
    missing += [name for name in _NUMBERS if name not in arrays]
    if missing:
        there = ", ".join(sorted(arrays)) or "nothing"
        raise ValueError(f"{missing[0]} is missing; there is: {there}")
    ranges = np.asarray(found["ranges"], np.float64)
    if "ranges" not in arrays:
        ranges = np.where(ranges > 0.0, ranges, np.nan)
    stamps = np.asarray(found["stamps"], np.float64)
    if ranges.ndim != 2 or stamps.shape != ranges.shape[:1]:
        shapes = f"{ranges.shape} and {stamps.shape}"
        raise ValueError(f"ranges must be (n, beams) and stamps (n,), they are {shapes}")
    odometry = found["odometry"]
    if odometry is None:
        return ranges, stamps, None
    poses = np.asarray(odometry, np.float64)
    if poses.shape != (len(ranges), 3):
        raise ValueError(f"odometry must be ({len(ranges)}, 3), it is {poses.shape}")
    return ranges, stamps, poses
