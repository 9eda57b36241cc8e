"""What came of a log, by an independent reference: how much hangs together, and what is wrong.

Poses count where the reference has one; without any reference all count for what needs none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import se2
from lineloom_core.geometry.angles import wrap_array
from numpy.typing import NDArray

WRONG_M = 1.0
"""A pose or relation that is further off is wrong."""

RELATION_WAY_M = 20.0
"""Relations reach so far along the reference's way."""

AGREE_M, AGREE_RAD = 0.4, math.radians(6.0)
"""A pose agrees with a pseudo reference where it is no further off."""

_APART = (1, 2, 4, 8, 16)

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PlacedRobot:
    """One robot's scans, in their order, as the map has them.

    poses: (n, 3), T_map_laser in the component's frame, NaN where unplaced. component: (n,), names,
    "" where unplaced. reference: (n, 3), NaN where there is none.
    """

    robot: str
    poses: Array
    component: NDArray[np.str_]
    reference: Array

    @property
    def placed(self) -> NDArray[np.bool_]:
        """Which scans are in the map, shape (n,)."""
        return np.asarray(self.component != "", dtype=np.bool_)

    @property
    def compared(self) -> NDArray[np.bool_]:
        """Which scans are in the map and have a reference, shape (n,)."""
        return self.placed & self.known

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which scans have a reference, shape (n,)."""
        return np.asarray(np.isfinite(self.reference).all(axis=1), dtype=np.bool_)


@dataclass(frozen=True, slots=True)
class LogFigures:
    """scans: processed. unplaced: of them. known: with a reference (all, where there is none).

    components: that hold a known scan. largest: known scans in the one with most. robots: all;
    in_largest: that have a scan in it. ate_rmse, ate_max [m]: of the largest after the best rigid
    alignment; agreeing: its scans within `AGREE_M` and `AGREE_RAD` after another one, which weighs
    headings too. compared: placed and known; wrong: of these, off by more than `WRONG_M` in their
    component. relations: of a robot's scans 1, 2, 4, 8 and 16 apart in one component and up to
    `RELATION_WAY_M` apart; relations_wrong: off by more than `WRONG_M`. None: nothing to compare.
    """

    scans: int
    unplaced: int
    known: int
    components: int
    largest: int
    robots: int
    in_largest: int
    ate_rmse: float | None
    ate_max: float | None
    agreeing: int | None
    compared: int
    wrong: int
    relations: int
    relations_wrong: int

    @property
    def share_in_largest(self) -> float:
        """Of all known scans."""
        return self.largest / max(1, self.known)

    @property
    def share_unplaced(self) -> float:
        """Of all scans."""
        return self.unplaced / max(1, self.scans)

    @property
    def share_wrong(self) -> float:
        """Of all placed scans that can be compared."""
        return self.wrong / max(1, self.compared)

    @property
    def share_relations_wrong(self) -> float:
        """Of all relations."""
        return self.relations_wrong / max(1, self.relations)

    @property
    def share_agreeing(self) -> float | None:
        """Of the scans in the largest component."""
        return None if self.agreeing is None else self.agreeing / max(1, self.largest)


def judge(robots: Sequence[PlacedRobot]) -> LogFigures:
    """Judge all robots of one map; `robots` must not be empty."""
    blind = not any(r.known.any() for r in robots)
    rows = [r.placed if blind else r.compared for r in robots]
    poses, truth, component, owner = (
        np.concatenate(parts)
        for parts in zip(
            *(
                (r.poses[m], r.reference[m], r.component[m], np.full(int(m.sum()), i))
                for i, (r, m) in enumerate(zip(robots, rows, strict=True))
            ),
            strict=True,
        )
    )
    names, counts = np.unique(component, return_counts=True)
    in_largest = component == names[counts.argmax()] if len(names) else np.zeros(0, dtype=bool)
    errors = None if blind else aligned_errors(poses[in_largest], truth[in_largest])
    relations = [(0, 0) if blind else _relations(r) for r in robots]
    return LogFigures(
        scans=sum(len(r.component) for r in robots),
        unplaced=sum(int(np.count_nonzero(~r.placed)) for r in robots),
        known=sum(len(r.component) if blind else int(r.known.sum()) for r in robots),
        components=len(names),
        largest=int(in_largest.sum()),
        robots=len(robots),
        in_largest=len(np.unique(owner[in_largest])),
        ate_rmse=_rms(errors),
        ate_max=float(errors.max()) if errors is not None and len(errors) else None,
        agreeing=None if blind else _agreeing(poses[in_largest], truth[in_largest]),
        compared=0 if blind else len(poses),
        wrong=0 if blind else _wrong(poses, truth, component),
        relations=sum(n for n, _ in relations),
        relations_wrong=sum(bad for _, bad in relations),
    )


def _wrong(poses: Array, truth: Array, component: NDArray[np.str_]) -> int:
    """Count poses that are off by more than a metre, each component aligned by itself."""
    total = 0
    for name in np.unique(component):
        own = component == name
        total += int(np.count_nonzero(aligned_errors(poses[own], truth[own]) > WRONG_M))
    return total


def _relations(robot: PlacedRobot) -> tuple[int, int]:
    """Count a robot's relations, and those of them that are off by more than a metre."""
    use = robot.compared
    poses, truth, component = robot.poses[use], robot.reference[use], robot.component[use]
    steps = np.hypot(*np.diff(truth[:, :2], axis=0).T) if len(truth) > 1 else np.empty(0)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    count = wrong = 0
    for apart in _APART:
        if len(poses) <= apart:
            break
        near = way[apart:] - way[:-apart] <= RELATION_WAY_M
        near &= component[:-apart] == component[apart:]
        off = relation_error(poses[:-apart], poses[apart:], truth[:-apart], truth[apart:])
        count += int(near.sum())
        wrong += int(np.count_nonzero(np.hypot(off[:, 0], off[:, 1])[near] > WRONG_M))
    return count, wrong


def relation_error(a: Array, b: Array, true_a: Array, true_b: Array) -> Array:
    """Return how b lies to a in the map, as seen from how it truly does, shape (n, 3)."""
    return se2.between(se2.between(true_a, true_b), se2.between(a, b))


def aligned_errors(
    poses: Array, truth: Array, by: NDArray[np.bool_] | slice = slice(None)
) -> Array:
    """Return distances after the best rigid motion of the positions is taken out, shape (n,) [m].

    by: which rows it is the best for. Unlike `trajectory.align_rigid` this has an answer for one
    pose, and for poses in one place.
    """
    if len(poses) == 0:
        return np.empty(0)
    a, b = (rows[:, :2] - rows[by, :2].mean(axis=0) for rows in (poses, truth))
    U, _, V = np.linalg.svd(a[by].T @ b[by])
    R = (U @ np.diag([1.0, np.sign(np.linalg.det(U @ V))]) @ V).T
    errors: Array = np.linalg.norm(a @ R.T - b, axis=1)
    return errors


def _agreeing(poses: Array, truth: Array) -> int:
    """Count poses within `AGREE_M` and `AGREE_RAD` of the reference.

    Positions and headings are aligned together, weighed by those two: a robot that turns on the
    spot has no positions to be aligned by.
    """
    if len(poses) == 0:
        return 0
    e, t = (rows[:, 0] + 1j * rows[:, 1] for rows in (poses, truth))
    headings = np.exp(1j * (truth[:, 2] - poses[:, 2])).sum() / AGREE_RAD**2
    spread = (np.conj(e - e.mean()) * (t - t.mean())).sum() / AGREE_M**2
    turn = float(np.angle(headings + spread))
    off = np.abs((e - e.mean()) * np.exp(1j * turn) - (t - t.mean()))
    turned = np.abs(wrap_array(poses[:, 2] + turn - truth[:, 2]))
    return int(np.count_nonzero((off <= AGREE_M) & (turned <= AGREE_RAD)))


def _rms(errors: Array | None) -> float | None:
    if errors is None or not len(errors):
        return None
    return float(np.sqrt(np.mean(errors**2)))
