"""Scans from files: logs by way of the core, JSON lines with nothing but the client."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from lineloom.cli.failure import CommandError, Exit
from lineloom.errors import InvalidScanError
from lineloom.scan_like import ScanLike, to_match_scan, to_wire

_JSON_SUFFIXES = {".jsonl", ".ndjson", ".json"}
_TINYSLAM_SUFFIXES = {".dat"}
_ADDRESSED = re.compile(r"^(?P<path>.+):(?P<line>[0-9]+)$")


@dataclass(frozen=True, slots=True)
class FileScan:
    """A scan of a file, the line it is on (0 where there are no lines), and whose it is where the
    file says so."""

    scan: ScanLike
    line: int
    robot: str | None = None


def read_scans(path: Path) -> Iterator[FileScan]:
    """Yield the scans of a file; its name tells the format. Broken lines end the command."""
    if path.suffix.lower() in _JSON_SUFFIXES:
        return _json_lines(path, for_matching=False)
    if path.suffix.lower() in _TINYSLAM_SUFFIXES:
        return _tinyslam(path)
    return _carmen(path)


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


def _carmen(path: Path) -> Iterator[FileScan]:
    try:
        from lineloom_core.io.carmen import CarmenError, read_carmen_records
    except ImportError:
        raise CommandError(
            f"{path}: reading CARMEN logs needs the core: `pip install lineloom-client[server]`"
        ) from None
    try:
        for record in read_carmen_records(path):
            yield FileScan(record.scan, record.line)
    except CarmenError as error:
        raise CommandError(str(error)) from None


def _tinyslam(path: Path) -> Iterator[FileScan]:
    try:
        from lineloom_core.io.tinyslam import TinySlamError, read_tinyslam
    except ImportError:
        raise CommandError(
            f"{path}: reading tinySLAM logs needs the core: `pip install lineloom-client[server]`"
        ) from None
    try:
        for scan in read_tinyslam(path):
            yield FileScan(scan, scan.seq + 1)
    except TinySlamError as error:
        raise CommandError(str(error)) from None
