"""Fitting and judging `localise`: `python -m lineloom_lab.evaluation.localise_calibration`.

Fits the score's constants (`lineloom_core.mapping.answers.localise_score`) on some seeds, then asks
about buildings of other seeds: how often "unique" is wrong, and how often it is said where the map
knows the place.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence

import numpy as np
from lineloom_core.mapping.answers.localise_score import FEATURES, descriptors

from lineloom_lab.evaluation.calibration import fit_logistic
from lineloom_lab.evaluation.localise_trials import KINDS, Trial, trials
from lineloom_lab.simulation import scanner_360, sick_lms200


def ask(seeds: Iterable[int], count: int, kinds: Sequence[str] = tuple(KINDS)) -> list[Trial]:
    """`count` questions about each kind of building, with each lidar, per seed."""
    asked: list[Trial] = []
    for seed in seeds:
        for kind in kinds:
            for lidar in (sick_lms200(), scanner_360()):
                # A small map now and then: what else looks alike is not known yet.
                asked += trials(kind, seed, lidar, count, duration_s=(90.0, 30.0, 60.0)[seed % 3])
    return asked


def report(asked: Sequence[Trial]) -> str:
    """A table: per kind of building what was said, and how often "unique" was wrong."""
    lines = [
        f"{'':18}{'asked':>7}{'unique':>8}{'wrong':>7}{'known':>8}{'found':>8}{'ambiguous':>11}"
    ]
    for kind in [*dict.fromkeys(t.kind for t in asked), "all"]:
        of = [t for t in asked if kind in (t.kind, "all")]
        unique = [t for t in of if t.answer.verdict == "unique"]
        known = [t for t in of if t.mapped]
        found = sum(t.right and t.answer.verdict == "unique" for t in known)
        ambiguous = sum(t.answer.verdict == "ambiguous" for t in of)
        lines.append(
            f"{kind:18}{len(of):11}{len(unique):11}{sum(t.wrongly_unique for t in of):11}"
            f"{len(known):11}{found / max(len(known), 1):11.0%}{ambiguous:11}"
        )
    return "\n".join(lines)


def main() -> None:
    """Fit on some seeds, report on others."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=48, help="questions per map")
    parser.add_argument("--seeds", type=int, default=6, help="seeds to fit on, and to judge by")
    options = parser.parse_args()
    fitted = [t for t in ask(range(100, 100 + options.seeds), options.count) if t.answer.hypotheses]
    x = np.array([descriptors(t.answer.hypotheses[0].checks) for t in fitted])
    weights, bias = fit_logistic(x, np.array([t.right for t in fitted]))
    print("FEATURES =", FEATURES)
    print("WEIGHTS =", tuple(round(float(w), 3) for w in weights))
    print("BIAS =", round(bias, 3))
    judged = ask(range(200, 200 + options.seeds), options.count)
    print(report(judged))
    answered = [t for t in judged if t.answer.hypotheses]
    p = np.array([t.answer.hypotheses[0].score for t in answered])
    right = np.array([t.right for t in answered])
    for low in np.arange(0.0, 1.0, 0.1):
        inside = (p >= low) & (p < low + 0.1 + 1e-9)
        if inside.any():
            said, was = p[inside].mean(), right[inside].mean()
            print(f"  said {said:.2f}  was {was:.2f}  n {inside.sum()}")


if __name__ == "__main__":
    main()
