"""From the body of a POST to scans for the log, and what is wrong with those that are not."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from lineloom.wire import FieldError, RejectedScan, Scan
from lineloom.wire.scan import STRICT_JSON
from lineloom_core.scan import InvalidScanError
from pydantic import ValidationError

from lineloom_service.convert import to_scan
from lineloom_service.errors import field_errors, invalid_body, pointer
from lineloom_service.request_body import Body
from lineloom_service.store.codec import encode_scan
from lineloom_service.store.records import Conflict, NewScan

_SLICE = 50
"""Scans decoded before other requests get their turn."""

_REASONS_SHOWN = 3

CONFLICT = "conflict"
"""The reason for a scan whose session has another one of its seq."""


@dataclass(slots=True)
class Intake:
    """What a POST brought."""

    scans: list[NewScan] = field(default_factory=list)
    rejected: list[RejectedScan] = field(default_factory=list)
    errors: list[FieldError] = field(default_factory=list)


class _BadScanError(Exception):
    def __init__(self, errors: Sequence[FieldError]) -> None:
        super().__init__()
        self.errors = errors


async def take_in(body: Body, max_batch: int) -> Intake:
    """Check and encode the scans of a body.

    Raises ProblemError (422) where there is no usable scan at all.
    """
    if not isinstance(body.value, dict):
        raise invalid_body([FieldError(pointer="", reason='must be a scan or {"scans": [...]}')])
    if "scans" not in body.value:
        try:
            return Intake([_new_scan(body.value, body.is_json, "")])
        except _BadScanError as bad:
            raise invalid_body(bad.errors) from None
    scans = _check_batch(body.value["scans"], max_batch)
    intake = Intake()
    for index, value in enumerate(scans):
        try:
            intake.scans.append(_new_scan(value, body.is_json, pointer("scans", index), index))
        except _BadScanError as bad:
            intake.errors += bad.errors
            intake.rejected.append(_rejected(index, value, bad.errors))
        if index % _SLICE == _SLICE - 1:
            await asyncio.sleep(0)
    if not intake.scans:
        raise invalid_body(intake.errors)
    return intake


def _check_batch(scans: Any, max_batch: int) -> list[Any]:
    reason = None
    if not isinstance(scans, list):
        reason = "must be a list of scans"
    elif not scans:
        reason = "must hold at least one scan"
    elif len(scans) > max_batch:
        reason = f"holds {len(scans)} scans, more than {max_batch}"
    if reason is not None:
        raise invalid_body([FieldError(pointer="/scans", reason=reason)])
    checked: list[Any] = scans
    return checked


def _new_scan(value: Any, is_json: bool, prefix: str, index: int = 0) -> NewScan:
    try:
        wire = Scan.model_validate(value, context=STRICT_JSON if is_json else None)
    except ValidationError as error:
        raise _BadScanError(field_errors(error, prefix)) from None
    try:
        scan = to_scan(wire)
    except InvalidScanError as error:
        fault = FieldError(pointer=prefix + pointer(error.field), reason=error.reason)
        raise _BadScanError([fault]) from None
    return NewScan(scan.session, wire.seq, encode_scan(scan), scan.stamp, index)


def _rejected(index: int, value: Any, errors: Sequence[FieldError]) -> RejectedScan:
    seq = value.get("seq") if isinstance(value, dict) else None
    prefix = pointer("scans", index)
    shown = [
        f"{error.pointer.removeprefix(prefix).lstrip('/') or 'scan'}: {error.reason}"
        for error in errors[:_REASONS_SHOWN]
    ]
    if len(errors) > _REASONS_SHOWN:
        shown.append(f"and {len(errors) - _REASONS_SHOWN} more")
    usable = isinstance(seq, int) and not isinstance(seq, bool) and 0 <= seq < 2**63
    return RejectedScan(
        index=index,
        seq=seq if usable else None,
        reason="; ".join(shown),
        pointer=errors[0].pointer or prefix,
    )


def conflicting(conflict: Conflict, *, batch: bool) -> RejectedScan:
    """Return what is answered of a scan whose name another one has. batch: it came in a list."""
    prefix = pointer("scans", conflict.index) if batch else ""
    return RejectedScan(
        index=conflict.index,
        seq=conflict.seq,
        reason=CONFLICT,
        pointer=prefix + pointer("seq"),
        detail=f"session {conflict.session!r} has another scan with seq {conflict.seq}, of stamp "
        f"{conflict.known:.6f}, this one's is {conflict.stamp:.6f}. seq has to grow from scan to "
        "scan: where its counter begins again, begin another session; where there is none, leave "
        "seq out; where two robots send under this name, give each its own",
    )
