"""How good a map of lines is, by the faces that were truly seen, or by itself where none is known.

Lines are carried into the world as the keyframes around them lie there (`near`: the shape of the
map), or all alike (`whole`: its place, drift and all).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from lineloom_core.mapping.answers.site_view import MapLine
from numpy.typing import NDArray

from lineloom_lab.evaluation.line_bench_truth import TrueFaces

_STEP_M = 0.02
_LIKE = math.cos(math.radians(10.0))
_TWIN_M, _TWIN_OVERLAP_M = 0.2, 0.2
_SAME_END_M = 0.02
_CORNER_REACH_M = 0.15
_SHORT_M, _LONG_M = 0.5, 1.0
_NEAR_M = 3.0


@dataclass(frozen=True, slots=True)
class LineFigures:
    """Of a map's lines, by length where not said otherwise.

    precision_3, precision_5: share that lies within 3, 5 cm of a wall's side, and along it.
    recall_3, recall_5: share of the seen faces that a line covers so. whole_5: `precision_5` of the
    lines as the whole map lies. pieces: lines a face, of faces that have any. corners: share of
    corners at which two lines meet within 2 cm. angle: rms against the face [rad]. false_lines:
    lines that are for the most part off every side by 10 cm. sigma_ratio: rms of the offset over
    sigma. All None without truth.
    lines, metres: of all. short: share of length in lines under half a metre. twins: metres per
    100 m that run beside a line of the same side within 20 cm. ends_met: share of the ends of lines
    from a metre on that coincide with another's within 2 cm.
    """

    lines: int
    metres: float
    short: float
    twins: float
    ends_met: float
    precision_3: float | None = None
    precision_5: float | None = None
    recall_3: float | None = None
    recall_5: float | None = None
    whole_5: float | None = None
    pieces: float | None = None
    corners: float | None = None
    angle: float | None = None
    false_lines: int | None = None
    sigma_ratio: float | None = None


def ends_of(lines: Sequence[MapLine]) -> NDArray[np.float64]:
    """Return x1, y1, x2, y2 of the lines, shape (n, 4) [m]."""
    return np.array([(w.x1, w.y1, w.x2, w.y2) for w in lines]).reshape(-1, 4)


def judge_alone(lines: NDArray[np.float64]) -> LineFigures:
    """Judge lines (n, 4) of one frame by themselves."""
    lengths = _lengths(lines)
    total = max(float(lengths.sum()), 1e-9)
    ends = lines.reshape(-1, 2)
    owner = np.repeat(np.arange(len(lines)), 2)
    met = np.zeros(len(ends), dtype=bool)
    for i in range(len(ends)):
        near = np.hypot(*(ends - ends[i]).T) <= _SAME_END_M
        met[i] = bool((near & (owner != owner[i])).any())
    long = np.repeat(lengths >= _LONG_M, 2)
    return LineFigures(
        lines=len(lines),
        metres=float(lengths.sum()),
        short=float(lengths[lengths < _SHORT_M].sum()) / total,
        twins=100.0 * _twin_metres(lines) / total,
        ends_met=float(met[long].mean()) if long.any() else 0.0,
    )


def carried(
    lines: NDArray[np.float64],
    mapped: NDArray[np.float64],
    true: NDArray[np.float64],
    *,
    near: bool,
) -> NDArray[np.float64]:
    """Return lines (n, 4) of the map in the world, by keyframes' poses (k, 3) in both."""
    moved = np.empty_like(lines)
    turn = true[:, 2] - mapped[:, 2]
    for i, line in enumerate(lines):
        middle = 0.5 * (line[:2] + line[2:])
        weight = np.ones(len(mapped))
        if near:
            square = ((mapped[:, :2] - middle) ** 2).sum(axis=1)
            weight = np.exp(-0.5 * (square - square.min()) / _NEAR_M**2)
        a = math.atan2(float(weight @ np.sin(turn)), float(weight @ np.cos(turn)))
        R = np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])
        shift = weight @ (true[:, :2] - mapped[:, :2] @ R.T) / weight.sum()
        moved[i] = (line.reshape(2, 2) @ R.T + shift).ravel()
    return moved


def judge_by_truth(
    near: NDArray[np.float64],
    whole: NDArray[np.float64],
    sigma: NDArray[np.float64],
    truth: TrueFaces,
) -> LineFigures:
    """Judge lines (n, 4) in the world, carried there in both ways; sigma (n,) [m]."""
    by_line, by_side = ([_fit(line, of) for line in near] for of in (truth.faces, truth.sides))
    lengths = _lengths(near)
    within = [_share(by_side, lengths, reach) for reach in (0.03, 0.05)]
    face_of = np.array([f[0] if f[1] <= 0.1 else -1 for f in map(_most, by_line)], dtype=int)
    covered = [_recall(truth.faces, near, reach) for reach in (0.03, 0.05)]
    known = face_of >= 0
    offset = np.array([_most(f)[1] for f in by_line])
    angle = np.array([_angle(near[i], truth.faces[face_of[i]]) for i in np.flatnonzero(known)])
    alone = judge_alone(near)
    return LineFigures(
        lines=alone.lines, metres=alone.metres, short=alone.short, twins=alone.twins,
        ends_met=alone.ends_met,
        precision_3=within[0], precision_5=within[1],
        recall_3=covered[0], recall_5=covered[1],
        whole_5=_share([_fit(line, truth.sides) for line in whole], lengths, 0.05),
        pieces=float(known.sum() / max(len(np.unique(face_of[known])), 1)),
        corners=_corners_met(near, truth),
        angle=float(np.sqrt(np.average(angle**2, weights=lengths[known]))) if known.any() else 0.0,
        false_lines=sum(_most(fit)[1] > 0.1 for fit in by_side),
        sigma_ratio=_rms(offset[known] / sigma[known]),
    )  # fmt: skip


def _lengths(lines: NDArray[np.float64]) -> NDArray[np.float64]:
    found: NDArray[np.float64] = np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1])
    return found


def _samples(line: NDArray[np.float64]) -> NDArray[np.float64]:
    count = max(round(math.hypot(line[2] - line[0], line[3] - line[1]) / _STEP_M), 1)
    t = ((np.arange(count) + 0.5) / count)[:, None]
    return line[:2] + t * (line[2:] - line[:2])


def _distances(points: NDArray[np.float64], lines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances of points (m, 2) to segments (n, 4): (m, n)."""
    d = lines[:, 2:] - lines[:, :2]
    square = np.maximum((d**2).sum(axis=1), 1e-12)
    away = points[:, None] - lines[None, :, :2]
    t = np.clip((away * d).sum(axis=2) / square, 0.0, 1.0)
    off = away - t[..., None] * d
    found: NDArray[np.float64] = np.hypot(off[..., 0], off[..., 1])
    return found


def _alike(line: NDArray[np.float64], lines: NDArray[np.float64]) -> NDArray[np.int64]:
    """Numbers of the lines that face the same way."""
    d = lines[:, 2:] - lines[:, :2]
    cosine = (
        d
        @ (line[2:] - line[:2])
        / np.maximum(np.hypot(*d.T) * math.hypot(*(line[2:] - line[:2])), 1e-12)
    )
    return np.flatnonzero(cosine >= _LIKE)


def _fit(
    line: NDArray[np.float64], faces: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Per sample of a line the nearest face that is alike, -1 for none, and how far it is."""
    points = _samples(line)
    alike = _alike(line, faces)
    if not len(alike):
        return np.full(len(points), -1), np.full(len(points), np.inf)
    away = _distances(points, faces[alike])
    best = away.argmin(axis=1)
    return alike[best], away[np.arange(len(points)), best]


def _most(fit: tuple[NDArray[np.int64], NDArray[np.float64]]) -> tuple[int, float]:
    """The face that most samples go with, and the median distance."""
    faces, away = fit
    names, counts = np.unique(faces, return_counts=True)
    return int(names[counts.argmax()]), float(np.median(away))


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _share(
    fits: Sequence[tuple[NDArray[np.int64], NDArray[np.float64]]],
    lengths: NDArray[np.float64],
    reach: float,
) -> float:
    good = [
        length * float((away <= reach).mean())
        for (_, away), length in zip(fits, lengths, strict=True)
    ]
    return float(sum(good) / max(lengths.sum(), 1e-9))


def _recall(faces: NDArray[np.float64], lines: NDArray[np.float64], reach: float) -> float:
    lengths = _lengths(faces)
    return _share([_fit(face, lines) for face in faces], lengths, reach)


def _angle(line: NDArray[np.float64], face: NDArray[np.float64]) -> float:
    u, v = line[2:] - line[:2], face[2:] - face[:2]
    return math.atan2(float(u[0] * v[1] - u[1] * v[0]), float(u @ v))


def _corners_met(lines: NDArray[np.float64], truth: TrueFaces) -> float:
    """A corner is met where lines along both its faces have ends within 2 cm of each other."""
    met = 0
    for x, y, a, b in truth.corners.tolist():
        sides = []
        for face in (int(a), int(b)):
            ends = lines[_alike(truth.faces[face], lines)].reshape(-1, 2)
            sides.append(ends[np.hypot(ends[:, 0] - x, ends[:, 1] - y) <= _CORNER_REACH_M])
        apart = np.hypot(*np.moveaxis(sides[0][:, None] - sides[1][None], 2, 0))
        met += bool((apart <= _SAME_END_M).any())
    return met / max(len(truth.corners), 1)


def _twin_metres(lines: NDArray[np.float64]) -> float:
    """Metres of lines that run beside another of the same side, nearer than a step in a wall."""
    total = 0.0
    for i, line in enumerate(lines):
        others = _alike(line, lines)
        others = others[others > i]
        length = math.hypot(line[2] - line[0], line[3] - line[1])
        u = (line[2:] - line[:2]) / length
        for j in others.tolist():
            d = lines[j].reshape(2, 2) - line[:2]
            low, high = np.sort(d @ u)
            overlap = min(high, length) - max(low, 0.0)
            across = abs(float((d[:, 1] * u[0] - d[:, 0] * u[1]).mean()))
            if overlap >= _TWIN_OVERLAP_M and across <= _TWIN_M:
                total += float(overlap)
    return total
