"""One sweep of a lidar as it travels: `sensor_msgs/LaserScan` field names and meaning."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal

from pydantic import Field, PlainSerializer, PlainValidator, ValidationError, ValidationInfo
from pydantic_core import InitErrorDetails, PydanticCustomError

from lineloom.wire.base import MAX_BEAMS, Number, Request, Seq

RangeValue = Number | Literal["inf", "-inf"] | None
"""One range as JSON has it."""

STRICT_JSON = {"non_finite": "refused"}
"""Validation context for values that came from JSON, where a bare NaN or Infinity is an error."""

_WORDS: dict[object, float] = {None: math.nan, "inf": math.inf, "-inf": -math.inf}
_PLAIN_NUMBERS = {float, int}
_MAX_REPORTED = 20


class _UnreadableError(Exception):
    """A value in `ranges` that is none of the things a range may be."""


def _range_value(value: object, finite_only: bool) -> float:
    if value is None or isinstance(value, str):
        try:
            return _WORDS[value]
        except KeyError:
            raise _UnreadableError from None
    # numpy's float64 is a float; a bool is an int, yet not a number to us.
    if isinstance(value, bool) or not isinstance(value, (float, int)):
        raise _UnreadableError
    try:
        number = float(value)
    except OverflowError:
        raise _UnreadableError from None
    if finite_only and not math.isfinite(number):
        raise _UnreadableError
    return number


def _read_one_by_one(values: Sequence[object], finite_only: bool) -> list[float]:
    numbers: list[float] = []
    errors: list[InitErrorDetails] = []
    for index, value in enumerate(values):
        try:
            numbers.append(_range_value(value, finite_only))
        except _UnreadableError:
            kind = PydanticCustomError(
                "range_value", 'must be a finite number, null, "inf" or "-inf"'
            )
            errors.append(InitErrorDetails(type=kind, loc=(index,), input=None))
            if len(errors) == _MAX_REPORTED:
                break
    if errors:
        raise ValidationError.from_exception_data("ranges", errors)
    return numbers


def _from_float32(data: bytes) -> Sequence[float]:
    if len(data) % 4:
        raise PydanticCustomError("range_bytes", "bytes must hold float32 values, little-endian")
    numbers = array("f")
    numbers.frombytes(data)
    return numbers


def _check_ranges(value: Any, info: ValidationInfo) -> Sequence[float]:
    """Take a list of ranges as JSON or msgpack has it, or packed float32; return floats.

    The common case, a list of plain finite numbers, costs two passes in C.
    """
    finite_only = info.context is not None and info.context.get("non_finite") == "refused"
    if isinstance(value, (bytes, bytearray)) and not finite_only:
        if len(value) > 4 * MAX_BEAMS:
            raise PydanticCustomError("too_long", f"must hold at most {MAX_BEAMS} values")
        value = _from_float32(bytes(value))
    if not isinstance(value, (list, tuple, array)):
        raise PydanticCustomError("list_type", "must be a list")
    if len(value) == 0:
        raise PydanticCustomError("too_short", "must hold at least one value")
    if len(value) > MAX_BEAMS:
        raise PydanticCustomError("too_long", f"holds {len(value)} values, more than {MAX_BEAMS}")
    if isinstance(value, array):
        return value
    if set(map(type, value)) <= _PLAIN_NUMBERS:
        try:
            if math.isfinite(sum(value)):
                return value
        except OverflowError:
            pass
    return _read_one_by_one(value, finite_only)


def _plain(values: Sequence[float]) -> Iterator[float | str | None]:
    for value in values:
        if math.isfinite(value):
            yield value
        elif math.isnan(value):
            yield None
        else:
            yield "inf" if value > 0 else "-inf"


def json_ranges(values: Sequence[float]) -> list[float | str | None]:
    """Return ranges as JSON has them: null for NaN, "inf" and "-inf" as words."""
    if math.isfinite(sum(values)):
        return list(values)
    return list(_plain(values))


Ranges = Annotated[
    Sequence[float],
    PlainValidator(
        _check_ranges,
        json_schema_input_type=Annotated[
            list[RangeValue], Field(min_length=1, max_length=MAX_BEAMS)
        ],
    ),
    PlainSerializer(json_ranges, return_type=list[float | str | None], when_used="json"),
]
"""Floats after REP-117: NaN = invalid, +inf = no return, -inf = too close."""


class Odometry(Request):
    """Pose of the base in the robot's own `odom` frame. A hint, never required."""

    x: Number = Field(description="metres")
    y: Number = Field(description="metres")
    theta: Number = Field(description="radians, counter-clockwise")


class Scan(Request):
    """One sweep, in the laser's frame; SI units and radians."""

    seq: Seq | None = Field(
        default=None,
        description="The client's counter; with `session` the idempotency key. Left out, the "
        "service numbers by stamp and arrival within the session.",
    )
    session: str = Field(
        default="0",
        max_length=128,
        pattern=r"^[^\x00-\x1f\x7f]*$",
        description="Changes when the robot restarts its counter.",
    )
    stamp: Number = Field(description="Seconds on the robot's own clock, time of the first ray.")
    angle_min: Number = Field(description="Direction of the first ray [rad].")
    angle_increment: Number = Field(
        description="May be negative; never 0 [rad].", json_schema_extra={"not": {"const": 0}}
    )
    angle_max: Number | None = Field(
        default=None,
        description="If given, must agree with the count of ranges to within half an increment.",
    )
    range_min: Number = Field(ge=0.0, description="metres")
    range_max: Number = Field(gt=0.0, description="metres")
    ranges: Ranges = Field(
        description='null = invalid; >= range_max or "inf" = no return; below range_min or '
        '"-inf" = too close.',
    )
    time_increment: Number = Field(default=0.0, ge=0.0, description="Seconds between two rays.")
    scan_time: Number = Field(default=0.0, ge=0.0, description="Seconds between two sweeps.")
    odometry: Odometry | None = None
