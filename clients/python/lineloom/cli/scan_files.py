"""Scans from files: logs by way of the core, JSON lines with nothing but the client."""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from lineloom.cli.failure import CommandError, Exit
from lineloom.errors import InvalidScanError
from lineloom.scan_like import ScanLike, to_match_scan, to_wire

_JSON_SUFFIXES = frozenset({".jsonl", ".ndjson", ".json"})
_ADDRESSED = re.compile(r"^(?P<path>.+):(?P<line>[0-9]+)$")


_TABLE = (
    "a table of numbers does not say what its columns are: save it with numpy as .npz, with "
    "ranges, stamps, angle_min, angle_increment and range_max (core/docs/formats.md)"
)
_NOT_READ = {
    ".rawlog": "rawlogs of MRPT are not read: `rawlog-edit --export-2d-scans-txt` makes tables of "
    "them, and numpy an .npz of those",
    ".txt": _TABLE,
    ".tsv": _TABLE,
    ".xz": "it is compressed: unpack it first",
    ".bz2": "it is compressed: unpack it first",
    ".zip": "it is an archive: unpack it first",
    ".tar": "it is an archive: unpack it first",
    ".pcap": "packets of a lidar are not read: record the scans with its driver",
    ".pcd": "point clouds are not read: record the scans of the lidar itself",
}
"""What people have and is not read, by the end of its name: what to do next."""


@dataclass(frozen=True, slots=True)
class FileScan:
    """A scan of a file, the line it is on (0 where there are no lines), and whose it is where the
    file says so."""

    scan: ScanLike
    line: int
    robot: str | None = None


@dataclass(frozen=True, slots=True)
class LogFormat:
    """name: for people. suffixes: of its files' names, in lower case. read: its scans, in order."""

    name: str
    suffixes: frozenset[str]
    read: Callable[[Path], Iterator[FileScan]]


def read_scans(path: Path) -> Iterator[FileScan]:
    """Yield the scans of a file; its name tells the format. Broken lines end the command."""
    *others, last = LOG_FORMATS.values()
    named = path.name.lower().removesuffix(".gz")
    for suffix, next_step in _NOT_READ.items():
        if named.endswith(suffix) and (next_step != _TABLE or _is_table(path)):
            raise CommandError(f"{path}: {next_step}. Read are {formats()}")
    fitting = (f for f in others if path.suffix.lower() in f.suffixes)
    chosen = next(fitting, last)
    if chosen is last and _is_dpslam(path):
        chosen = LOG_FORMATS["dpslam"]
    return chosen.read(path)


def formats() -> str:
    """Return what can be read, for people."""
    return ", ".join(known.name for known in LOG_FORMATS.values()) + ", ROS bags and MCAP"


def _is_table(path: Path) -> bool:
    """Whether a text begins with numbers: CARMEN's logs begin with a word."""
    with path.open("rb") as file:
        lines = file.read(1024).decode(errors="replace").splitlines()
    first = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    try:
        float(re.split(r"[\s,;]+", first.strip())[0])
    except ValueError:
        return False
    return True


def _is_dpslam(path: Path) -> bool:
    """Whether a log with CARMEN's ending is one of DP-SLAM: they have the same."""
    with path.open("rb") as file:
        return file.read(1024).lstrip().startswith((b"Odometry ", b"Laser "))


def read_one(reference: str) -> FileScan:
    """Return the scan that `FILE` or `FILE:LINE` names; the first one without a line."""
    addressed = _ADDRESSED.match(reference)
    # A file may really be called so.
    if addressed is None or Path(reference).exists():
        path, line = Path(reference), None
    else:
        path, line = Path(addressed["path"]), int(addressed["line"])
    if path.suffix.lower() == ".json":
        return FileScan(_checked(_whole(path), path, 1, for_matching=True), 1)
    is_json = path.suffix.lower() in _JSON_SUFFIXES
    scans = _json_lines(path, for_matching=True) if is_json else read_scans(path)
    for found in scans:
        if line is None or found.line == line:
            return found
        if found.line > line:
            break
    raise CommandError(
        f"{path} holds no scan" + ("" if line is None else f" on line {line}"), Exit.FAILED
    )


def _json_lines(path: Path, *, for_matching: bool) -> Iterator[FileScan]:
    with path.open(encoding="utf-8", errors="replace") as lines:
        for number, text in enumerate(lines, start=1):
            if text.isspace():
                continue
            try:
                fields = json.loads(text, parse_constant=_refuse)
            except ValueError as error:
                raise CommandError(f"{path}:{number}: not JSON: {error}") from None
            scan = _checked(fields, path, number, for_matching=for_matching)
            robot = fields.get("robot")
            if robot is not None and not isinstance(robot, str):
                raise CommandError(f"{path}:{number}: robot: must be a string")
            yield FileScan(scan, number, robot)


def _whole(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse)
    except ValueError as error:
        raise CommandError(f"{path}: not JSON: {error}") from None


def _checked(fields: Any, path: Path, line: int, *, for_matching: bool) -> ScanLike:
    if not isinstance(fields, dict):
        raise CommandError(f"{path}:{line}: a scan is a JSON object with the contract's fields")
    try:
        return to_match_scan(fields) if for_matching else to_wire(fields)
    except InvalidScanError as error:
        raise CommandError(f"{path}:{line}: {error}") from None


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f'{constant} is not JSON: write null, "inf" or "-inf"')


def _log(module: str, name: str, path: Path) -> Iterator[FileScan]:
    try:
        reader = importlib.import_module(f"lineloom_core.io.{module}")
        log_error: type[Exception] = importlib.import_module("lineloom_core.io.log_scan").LogError
    except ImportError:
        raise CommandError(
            f"{path}: reading {name} logs needs the core: `pip install lineloom-client[server]`"
        ) from None
    try:
        for found in reader.read_log(path):
            yield FileScan(found.scan, found.line)
    except log_error as error:
        raise CommandError(str(error)) from None


LOG_FORMATS: Mapping[str, LogFormat] = {
    "jsonl": LogFormat("JSON lines", _JSON_SUFFIXES, partial(_json_lines, for_matching=False)),
    "npz": LogFormat("numpy (.npz)", frozenset({".npz"}), partial(_log, "npz", "numpy")),
    "rostopic": LogFormat(
        "`rostopic echo -p`", frozenset({".csv"}), partial(_log, "rostopic", "CSV")
    ),
    "dpslam": LogFormat("DP-SLAM", frozenset({".dpslam"}), partial(_log, "dpslam", "DP-SLAM")),
    "tinyslam": LogFormat("tinySLAM", frozenset({".dat"}), partial(_log, "tinyslam", "tinySLAM")),
    "carmen": LogFormat("CARMEN", frozenset(), partial(_log, "carmen", "CARMEN")),
}
"""By the name of the module in `lineloom_core.io`; the last one reads what no other claims."""
