"""Numba kernels of the matcher's step 5: points of one side against the sweeps of the other.

A sweep is (ranges, angle_min, angle_increment) at a pose (x, y, theta). Slow twins:
tests/core/matching/slow_twins.py.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.kernels import kernel

MATCHED, CONFLICT, OCCLUDED, OUTSIDE = 0, 1, 2, 3


@kernel
def bearing(y, x):  # type: ignore[no-untyped-def]
    """atan2 to within 1e-5 rad, a thousandth of a beam's spacing, in a third of the time."""
    ax, ay = abs(x), abs(y)
    high = max(ax, ay)
    if high == 0.0:
        return 0.0
    t = min(ax, ay) / high
    q = t * t
    a = t * (0.99997726 + q * (-0.33262347 + q * (0.19354346 + q * (
        -0.11643287 + q * (0.05265332 - 0.01172120 * q)))))  # fmt: skip
    if ay > ax:
        a = 0.5 * math.pi - a
    if x < 0.0:
        a = math.pi - a
    return -a if y < 0.0 else a


@kernel
def beam_of(x, y, angle_min, per_radian, turn):  # type: ignore[no-untyped-def]
    """The beam nearest to the direction of (x, y); may be beyond the last one."""
    f = (bearing(y, x) - angle_min) * per_radian + 0.5
    if f < 0.0:
        f += turn
    elif f >= turn:
        f -= turn
    if f < 0.0 or f >= turn:  # angle_min more than a turn away
        f -= turn * math.floor(f / turn)
    return int(f)


@kernel
def judge_point(x, y, ranges, angle_min, per_radian, turn, base, slope):  # type: ignore[no-untyped-def]
    """One point in the frame of one sweep: MATCHED, CONFLICT, OCCLUDED or OUTSIDE.

    A conflict is a point in front of what the beam measured; a beam without return proves nothing.
    per_radian: beams per radian; turn: beams per full turn.
    """
    n = ranges.shape[0]
    b = beam_of(x, y, angle_min, per_radian, turn)
    if b >= n:
        return OUTSIDE
    r = ranges[b]
    if not math.isfinite(r):
        return OUTSIDE
    rho = math.sqrt(x * x + y * y)
    tol = base + slope * rho
    if abs(rho - r) <= tol:
        return MATCHED
    nearest = r
    for q in (b - 1, b + 1):
        if 0 <= q < n:
            p = ranges[q]
            if not math.isfinite(p):
                continue
            # Between two neighbouring returns the surface is anywhere between their ranges.
            if abs(rho - p) <= tol or (abs(p - r) < 0.5 and (p - rho) * (r - rho) <= 0.0):
                return MATCHED
            nearest = min(nearest, p)
    return CONFLICT if rho < nearest - tol else OCCLUDED


@kernel
def judge_points(  # type: ignore[no-untyped-def]
    points, spacing, step, pose, ranges, angle_min, angle_increment, base, slope, counts
):
    """Step 5, one way: hold points, moved by `pose`, against a sweep in polar form.

    counts[MATCHED, CONFLICT, OCCLUDED, OUTSIDE] grow by each point's weight, its share of wall:
    the distance of neighbouring beams there, at most 5 cm, so that near clutter does not outvote.
    spacing: angle between the beams that measured the points, which may be of another lidar.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    per_radian = 1.0 / angle_increment
    turn = 2.0 * math.pi * per_radian
    for k in range(0, points.shape[0], step):
        px, py = points[k, 0], points[k, 1]
        w = min(math.sqrt(px * px + py * py) * spacing, 0.05)
        x = c * px - s * py + pose[0]
        y = s * px + c * py + pose[1]
        counts[judge_point(x, y, ranges, angle_min, per_radian, turn, base, slope)] += w


@kernel
def judge_each(points, pose, ranges, angle_min, angle_increment, base, slope, verdicts):  # type: ignore[no-untyped-def]
    """`judge_point` for every point (n, 2), moved by `pose` into the sweep's frame."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    per_radian = 1.0 / angle_increment
    turn = 2.0 * math.pi * per_radian
    for k in range(points.shape[0]):
        x = c * points[k, 0] - s * points[k, 1] + pose[0]
        y = s * points[k, 0] + c * points[k, 1] + pose[1]
        verdicts[k] = judge_point(x, y, ranges, angle_min, per_radian, turn, base, slope)


@kernel
def thin_points(points, spacing, stride):  # type: ignore[no-untyped-def]
    """Every so many metres of wall one point, (k, 2): each stands for `stride` metres.

    The wall of a point is what `judge_points` takes it for: the beams' distance, at most 5 cm.
    """
    out = np.empty_like(points)
    count = 0
    sum_ = 0.5 * stride
    for k in range(points.shape[0]):
        px, py = points[k, 0], points[k, 1]
        sum_ += min(math.sqrt(px * px + py * py) * spacing, 0.05)
        if sum_ >= stride:
            sum_ -= stride
            out[count, 0], out[count, 1] = px, py
            count += 1
    return out[:count]


@kernel
def judge_thinned(ref, cur, ref_thin, cur_thin, pose, base, slope, counts):  # type: ignore[no-untyped-def]
    """`judge_pair` of two sweeps by thinned points: counts (4,) are numbers of points."""
    counts[:] = 0.0
    c, s = math.cos(pose[2]), math.sin(pose[2])
    tx, ty = pose[0], pose[1]
    per_radian = 1.0 / ref.angle_increment
    turn = 2.0 * math.pi * per_radian
    for k in range(cur_thin.shape[0]):
        px, py = cur_thin[k, 0], cur_thin[k, 1]
        x, y = c * px - s * py + tx, s * px + c * py + ty
        counts[judge_point(x, y, ref.ranges, ref.angle_min, per_radian, turn, base, slope)] += 1.0
    per_radian = 1.0 / cur.angle_increment
    turn = 2.0 * math.pi * per_radian
    for k in range(ref_thin.shape[0]):
        px, py = ref_thin[k, 0] - tx, ref_thin[k, 1] - ty
        x, y = c * px + s * py, c * py - s * px
        counts[judge_point(x, y, cur.ranges, cur.angle_min, per_radian, turn, base, slope)] += 1.0


@kernel
def judge_cloud(  # type: ignore[no-untyped-def]
    points, step, pose, ranges, angle_mins, angle_increments, poses, base, slope, counts
):
    """Hold points (frame A, moved by `pose` into frame B) against all sweeps of B.

    ranges (k, n), angle_mins, angle_increments (k,), poses (k, 3) of the sweeps in B. A point is
    matched where at least as many sweeps measured it as saw through it.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    sweeps = ranges.shape[0]
    cs, ss = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    per_radian = 1.0 / angle_increments
    turns = 2.0 * math.pi * per_radian
    for k in range(0, points.shape[0], step):
        x = c * points[k, 0] - s * points[k, 1] + pose[0]
        y = s * points[k, 0] + c * points[k, 1] + pose[1]
        hits = misses = behind = 0
        for q in range(sweeps):
            dx, dy = x - poses[q, 0], y - poses[q, 1]
            verdict = judge_point(
                cs[q] * dx + ss[q] * dy, cs[q] * dy - ss[q] * dx, ranges[q],
                angle_mins[q], per_radian[q], turns[q], base, slope,
            )  # fmt: skip
            if verdict == MATCHED:
                hits += 1
            elif verdict == CONFLICT:
                misses += 1
            elif verdict == OCCLUDED:
                behind += 1
        if hits > 0 and hits >= misses:
            counts[MATCHED] += 1.0
        elif misses > 0:
            counts[CONFLICT] += 1.0
        elif behind > 0:
            counts[OCCLUDED] += 1.0
        else:
            counts[OUTSIDE] += 1.0


@kernel
def invert_pose(pose, out):  # type: ignore[no-untyped-def]
    """out = pose^-1."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    out[0] = -c * pose[0] - s * pose[1]
    out[1] = s * pose[0] - c * pose[1]
    out[2] = -pose[2]


@kernel
def judge_pair(  # type: ignore[no-untyped-def]
    ref_points,
    ref_ranges,
    ref_min,
    ref_inc,
    cur_points,
    cur_ranges,
    cur_min,
    cur_inc,
    pose,
    step,
    base,
    slope,
    counts,
):
    """Free-space check both ways between two single sweeps; counts (4,) is overwritten."""
    counts[:] = 0.0
    judge_points(cur_points, cur_inc, step, pose, ref_ranges, ref_min, ref_inc, base, slope, counts)
    back = np.empty(3)
    invert_pose(pose, back)
    judge_points(ref_points, ref_inc, step, back, cur_ranges, cur_min, cur_inc, base, slope, counts)
