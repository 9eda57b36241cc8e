"""TF without ROS: transforms by time, along the way from one frame to another."""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass, field
from typing import Any

from lineloom.bridge.robot_bridge import NoTransformError
from lineloom.bridge.stamps import SECOND, nanoseconds

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

_KEPT_NS = 10 * SECOND
_BACK_NS = SECOND
"""A transform this much older than the latest: the clock was set back, or a bag begins anew."""


@dataclass(frozen=True)
class Rigid:
    """T_parent_child: translation [m] and rotation as x, y, z, w."""

    translation: Vector = (0.0, 0.0, 0.0)
    rotation: Quaternion = (0.0, 0.0, 0.0, 1.0)

    def __matmul__(self, other: Rigid) -> Rigid:
        """Compose."""
        moved = rotated(self.rotation, other.translation)
        x, y, z = (a + b for a, b in zip(self.translation, moved, strict=True))
        return Rigid((x, y, z), _product(self.rotation, other.rotation))

    def inverse(self) -> Rigid:
        """Return T_child_parent."""
        x, y, z, w = self.rotation
        back = (-x, -y, -z, w)
        moved = rotated(back, self.translation)
        return Rigid((-moved[0], -moved[1], -moved[2]), back)


@dataclass
class _Edge:
    """A child's transforms in its parents. stamps: rising; () where it is static."""

    stamps: list[int] = field(default_factory=list)
    values: list[tuple[str, Rigid]] = field(default_factory=list)
    static: tuple[str, Rigid] | None = None


class TransformTree:
    """Keeps ten seconds."""

    def __init__(self) -> None:
        self._edges: dict[str, _Edge] = {}

    def put(self, message: Any, *, static: bool) -> None:
        """Take a geometry_msgs/TransformStamped."""
        value = message.header.frame_id.lstrip("/"), _rigid(message.transform)
        edge = self._edges.setdefault(message.child_frame_id.lstrip("/"), _Edge())
        if static:
            edge.static = value
            return
        stamp = nanoseconds(message.header.stamp)
        if edge.stamps and edge.stamps[-1] - stamp >= _BACK_NS:
            edge.stamps.clear()
            edge.values.clear()
        place = bisect_left(edge.stamps, stamp)
        edge.stamps.insert(place, stamp)
        edge.values.insert(place, value)
        old = bisect_left(edge.stamps, edge.stamps[-1] - _KEPT_NS)
        del edge.stamps[:old], edge.values[:old]

    def lookup(self, target: str, source: str, stamp: int | None) -> Rigid:
        """Return T_target_source at a time [ns], or the latest where that is None.

        Interpolates, and never goes beyond what it was told. Raises NoTransformError.
        """
        above, below = self._way_up(target, stamp), self._way_up(source, stamp)
        shared = next((frame for frame in below if frame in above), None)
        if shared is None:
            raise NoTransformError(f"no transform from {source} to {target}")
        return above[shared].inverse() @ below[shared]

    def _way_up(self, frame: str, stamp: int | None) -> dict[str, Rigid]:
        """Return T_ancestor_frame by ancestor, itself first, as far as is known at the time."""
        found = {frame: Rigid()}
        at = frame
        while (step := self._step(at, stamp)) is not None and step[0] not in found:
            found[step[0]] = step[1] @ found[at]
            at = step[0]
        return found

    def _step(self, child: str, stamp: int | None) -> tuple[str, Rigid] | None:
        edge = self._edges.get(child)
        if edge is None or edge.static is not None or not edge.stamps:
            return None if edge is None else edge.static
        if stamp is None:
            return edge.values[-1]
        if not edge.stamps[0] <= stamp <= edge.stamps[-1]:
            return None
        after = bisect_left(edge.stamps, stamp)
        parent, value = edge.values[after]
        before, earlier = edge.values[max(after - 1, 0)]
        if edge.stamps[after] == stamp or before != parent:
            return parent, value
        share = (stamp - edge.stamps[after - 1]) / (edge.stamps[after] - edge.stamps[after - 1])
        return parent, _between(earlier, value, share)


def _rigid(transform: Any) -> Rigid:
    t, q = transform.translation, transform.rotation
    size = math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w) or 1.0
    return Rigid((t.x, t.y, t.z), (q.x / size, q.y / size, q.z / size, q.w / size))


def _between(a: Rigid, b: Rigid, share: float) -> Rigid:
    """Interpolate; rotations straight and brought to length one: steps of odometry are small."""
    x, y, z = (u + share * (v - u) for u, v in zip(a.translation, b.translation, strict=True))
    p, q = a.rotation, b.rotation
    sign = 1.0 if sum(u * v for u, v in zip(p, q, strict=True)) >= 0.0 else -1.0
    mixed = [(1.0 - share) * u + share * sign * v for u, v in zip(p, q, strict=True)]
    size = math.sqrt(sum(v * v for v in mixed)) or 1.0
    return Rigid((x, y, z), (mixed[0] / size, mixed[1] / size, mixed[2] / size, mixed[3] / size))


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def rotated(q: Quaternion, v: Vector) -> Vector:
    """Return a vector turned by a quaternion."""
    x, y, z, _ = _product(_product(q, (*v, 0.0)), (-q[0], -q[1], -q[2], q[3]))
    return x, y, z
