"""Whatever a robot holds a scan in, as the contract's scan.

Taken: `lineloom.wire.Scan`, a mapping with the contract's field names, or any object with them as
attributes (`lineloom_core.scan.Scan` is one). Numbers and lists may be numpy's: they are told by
their `item` and `tolist`, so that a robot's client needs no numpy.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Protocol, TypeVar

from pydantic import ValidationError

from lineloom.errors import InvalidScanError
from lineloom.wire import MAX_BATCH, MatchScan, Scan

MAX_BATCH_VALUES = 400_000
"""Ranges in one POST: 20 bytes each as JSON stay well under the 16 MiB the service takes."""

_ScanT = TypeVar("_ScanT", bound=Scan)


class ScanObject(Protocol):
    """An object with the contract's fields; those with defaults may be missing."""

    @property
    def stamp(self) -> float: ...
    @property
    def angle_min(self) -> float: ...
    @property
    def angle_increment(self) -> float: ...
    @property
    def range_min(self) -> float: ...
    @property
    def range_max(self) -> float: ...
    @property
    def ranges(self) -> Any: ...


ScanLike = Scan | Mapping[str, Any] | ScanObject


def to_wire(scan: ScanLike, **changes: Any) -> Scan:
    """Return the scan as the contract's, or raise InvalidScanError naming the field.

    changes: fields that override the scan's own.
    """
    if isinstance(scan, Scan) and not changes:
        return scan
    return _validated(Scan, fields_of(scan) | changes)


def to_match_scan(scan: ScanLike) -> MatchScan:
    """Return the scan for `/v1/match`, where counter and clock may be missing."""
    if isinstance(scan, MatchScan):
        return scan
    return _validated(MatchScan, fields_of(scan))


def fields_of(scan: ScanLike) -> dict[str, Any]:
    """Return the contract's fields that the scan has, in plain Python types."""
    if isinstance(scan, Mapping):
        found = {name: scan[name] for name in Scan.model_fields if name in scan}
    else:
        found = {name: getattr(scan, name) for name in Scan.model_fields if hasattr(scan, name)}
    fields = {name: _plain(value) for name, value in found.items() if value is not None}
    odometry = fields.get("odometry")
    if odometry is not None and not isinstance(odometry, Mapping):
        pose = {name: getattr(odometry, name, None) for name in ("x", "y", "theta")}
        fields["odometry"] = {name: _plain(value) for name, value in pose.items()}
    return fields


def batches(scans: Iterable[ScanLike], size: int) -> Iterator[list[Scan]]:
    """Yield lists of at most `size` scans that stay within the contract's limits."""
    if not 1 <= size <= MAX_BATCH:
        raise ValueError(f"a batch holds 1 to {MAX_BATCH} scans, not {size}")
    batch: list[Scan] = []
    values = 0
    for scan in map(to_wire, scans):
        if batch and (len(batch) == size or values + len(scan.ranges) > MAX_BATCH_VALUES):
            yield batch
            batch, values = [], 0
        batch.append(scan)
        values += len(scan.ranges)
    if batch:
        yield batch


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        # A numpy scalar has it too, and answers with a Python number.
        return value.tolist()
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    return value


def _validated(kind: type[_ScanT], fields: dict[str, Any]) -> _ScanT:
    try:
        return kind.model_validate(fields)
    except ValidationError as error:
        first = error.errors()[0]
        where = "/".join(str(part) for part in first["loc"]) or "scan"
        raise InvalidScanError(where, first["msg"]) from None
