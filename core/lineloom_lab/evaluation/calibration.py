"""Fitting the matcher's score on simulated pairs: `python -m lineloom_lab.evaluation.calibration`.

Two logistic regressions (Newton's method with a small ridge) on the matcher's own figures: is the
best hypothesis right but for a slide, and if so, is the slide right too. Prints the constants of
`lineloom_core.matching.score`, and how well the probabilities hold on worlds that were not fitted.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lineloom_core.matching import LineMatcher
from lineloom_core.matching.score import (
    FAMILY_FEATURES,
    SLIDE_FEATURES,
    family_descriptors,
    slide_descriptors,
)
from numpy.typing import NDArray

from lineloom_lab.evaluation.pose_error import pose_error
from lineloom_lab.evaluation.simulated_pairs import SimulatedPair, driven_pairs, simulated_pairs
from lineloom_lab.simulation import World, rectangle, scanner_360, sick_lms200, world_named

WORLDS = ("office", "rooms", "corridors")
EMPTY_ROOMS = ((5.0, 5.0), (6.0, 6.0), (8.0, 5.0), (7.0, 3.0))
PEOPLE = 8
NEGATIVE_SHARE = 0.45
RIGHT_WITHIN = (0.3, math.radians(5.0))
Model = tuple[NDArray[np.float64], float]


@dataclass(frozen=True, slots=True)
class Sample:
    """The descriptors of one answer, and how far its best hypothesis was right."""

    family: list[float]
    slide: list[float]
    right_but_for_a_slide: bool
    right: bool


def samples(worlds: Iterable[tuple[World, int]], pairs_each: int) -> list[Sample]:
    """Match pairs of random poses and of drives through each world (with its seed)."""
    matcher = LineMatcher()
    found = []
    for world, seed in worlds:
        for pair in _pairs(world, seed, pairs_each):
            result = matcher.match(pair.reference, pair.current)
            if not result.checks or result.best is None:
                continue
            error = pose_error(result.best, pair.T_reference_current)
            turned = pair.negative or error.rotation >= RIGHT_WITHIN[1]
            across = error.across(result.checks["axis"])
            found.append(
                Sample(
                    family_descriptors(result.checks),
                    slide_descriptors(result.checks),
                    not turned and min(across, error.translation) < RIGHT_WITHIN[0],
                    not turned and error.translation < RIGHT_WITHIN[0],
                )
            )
    return found


def calibration_worlds(
    seeds: Sequence[int], floorplans: Path | None
) -> Iterator[tuple[World, int]]:
    """Made-up buildings, empty rooms whose symmetry nobody can tell, and floor plans if given."""
    for seed in seeds:
        yield from ((world_named(name, seed), seed) for name in WORLDS)
    yield from ((rectangle(*size), seeds[0]) for size in EMPTY_ROOMS)
    if floorplans is not None:
        for seed in seeds[:2]:
            for file in sorted(floorplans.glob("*.txt")):
                yield World.from_text(file), seed


def fit_logistic(x: NDArray[np.float64], y: NDArray[np.bool_], ridge: float = 1.0) -> Model:
    """Weights (k,) and bias of the logistic model, by Newton's method."""
    a = np.column_stack([x, np.ones(len(x))])
    w = np.zeros(a.shape[1])
    for _ in range(50):
        p = 1.0 / (1.0 + np.exp(-np.clip(a @ w, -30, 30)))
        gradient = a.T @ (y - p) - ridge * w
        hessian = (a * (p * (1 - p))[:, None]).T @ a + ridge * np.eye(len(w))
        step = np.linalg.solve(hessian, gradient)
        w = w + step
        if np.abs(step).max() < 1e-9:
            break
    return w[:-1], float(w[-1])


def fit_both(found: Sequence[Sample]) -> tuple[Model, Model]:
    """The model of the family on all answers, that of the slide where the family is right."""
    family = fit_logistic(
        np.array([s.family for s in found]), np.array([s.right_but_for_a_slide for s in found])
    )
    right = [s for s in found if s.right_but_for_a_slide]
    slide = fit_logistic(np.array([s.slide for s in right]), np.array([s.right for s in right]))
    return family, slide


def main() -> None:
    """Fit on some seeds, report on others."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=80, help="pairs per world and lidar")
    parser.add_argument("--floorplans", type=Path, help="folder of *.txt floor plans to use too")
    options = parser.parse_args()
    worlds = calibration_worlds(range(100, 106), options.floorplans)
    found = samples(worlds, options.pairs)
    family, slide = fit_both(found)
    _print_model("FAMILY", FAMILY_FEATURES, family)
    _print_model("SLIDE", SLIDE_FEATURES, slide)
    others = samples(calibration_worlds(range(200, 203), None), options.pairs)
    said = _predict(family, [s.family for s in others]) * _predict(slide, [s.slide for s in others])
    was = np.array([s.right for s in others])
    print(f"{len(was)} pairs of other worlds, {100 * was.mean():.1f} % right")
    for low in np.arange(0.0, 1.0, 0.1):
        inside = (said >= low) & (said < low + 0.1)
        if inside.any():
            print(
                f"  said {said[inside].mean():.2f}  was {was[inside].mean():.2f}  n {inside.sum()}"
            )


def _pairs(world: World, seed: int, count: int) -> Iterator[SimulatedPair]:
    """As many pairs of a half-turn lidar by random poses and by drives; a few of a full turn."""
    kinds: tuple[Callable[..., Iterator[SimulatedPair]], ...] = (simulated_pairs, driven_pairs)
    for kind, draw in enumerate(kinds):
        for lidar, n in ((sick_lms200(), count), (scanner_360(), max(count // 4, 1))):
            rng = np.random.default_rng([seed, kind, lidar.beams])
            yield from draw(
                world, lidar, rng, n, people=PEOPLE, negative_share=_negatives_of(world)
            )


def _negatives_of(world: World) -> float:
    """No two places of a small room are far enough apart for a negative pair."""
    x0, y0, x1, y1 = world.bounds
    return NEGATIVE_SHARE if math.hypot(x1 - x0, y1 - y0) > 20.0 else 0.0


def _predict(model: Model, rows: Sequence[list[float]]) -> NDArray[np.float64]:
    weights, bias = model
    p: NDArray[np.float64] = 1.0 / (1.0 + np.exp(-(np.array(rows) @ weights + bias)))
    return p


def _print_model(name: str, features: Sequence[str], model: Model) -> None:
    weights, bias = model
    print(f"# {', '.join(features)}")
    print(f"{name}_WEIGHTS =", tuple(round(float(w), 3) for w in weights))
    print(f"{name}_BIAS =", round(bias, 3))


if __name__ == "__main__":
    main()
