"""Messages that are JSON in an MCAP file: ROS's own fields, or Foxglove's names for them."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace
from typing import Any

_FAR_M = 100.0
"""Foxglove's LaserScan has no limits of its ranges."""


def from_json(raw: bytes) -> SimpleNamespace:
    """Return a message with the attributes that ROS's have. Raises ValueError."""
    fields = json.loads(raw)
    if not isinstance(fields, dict):
        raise ValueError("a message is a JSON object")
    if "start_angle" in fields:
        return _foxglove_scan(fields)
    message: SimpleNamespace = _attributes(fields)
    if hasattr(message, "ranges"):
        message.ranges = _ranges(fields["ranges"])
    return message


def _foxglove_scan(fields: dict[str, Any]) -> SimpleNamespace:
    ranges = _ranges(fields["ranges"])
    first, last = float(fields["start_angle"]), float(fields["end_angle"])
    stamp = fields.get("timestamp", {})
    nanoseconds = stamp.get("nsec", stamp.get("nanosec", 0))
    return SimpleNamespace(
        header=SimpleNamespace(
            stamp=SimpleNamespace(sec=stamp.get("sec", 0), nanosec=nanoseconds),
            frame_id=str(fields.get("frame_id", "")),
        ),
        angle_min=first,
        angle_max=last,
        angle_increment=(last - first) / max(len(ranges) - 1, 1),
        time_increment=0.0,
        scan_time=0.0,
        range_min=0.0,
        range_max=_FAR_M,
        ranges=ranges,
    )


def _ranges(values: list[Any]) -> list[float]:
    """Return ranges; JSON has neither NaN nor infinities, so writers spell them or leave null."""
    words = {"inf": math.inf, "infinity": math.inf, "-inf": -math.inf, "-infinity": -math.inf}
    return [
        words.get(v.lower(), math.nan)
        if isinstance(v, str)
        else math.nan
        if v is None
        else float(v)
        for v in values
    ]


def _attributes(value: Any) -> Any:
    if isinstance(value, dict):
        return SimpleNamespace(
            **{"nanosec" if k == "nsec" else k: _attributes(v) for k, v in value.items()}
        )
    return [_attributes(v) for v in value] if isinstance(value, list) else value
