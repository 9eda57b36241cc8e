"""How probable it is that a set of recognitions which would join two components is false.

A logistic model of the figures of `checks.JOINED`, one row each: what is made of the figure, and
how much that weighs. Each row's part, about what is usual, is what it adds to the log-odds that the
set is false; with `PRIOR` they make the sum. Fitted on simulated trials over many lidars and
buildings such as `python -m lineloom_lab.evaluation.join_calibration` makes, which holds every
weight to the sign that reason gives it, and frozen here. Small probabilities are too sure: a
threshold, no rate.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from lineloom_core.check import Figures

PRIOR = -1.745
"""Log-odds that the best set between two strangers is false, all figures being as usual."""

KIN = math.log(0.1 / 0.9)
"""Added between parts of one robot's session: it is probably where it was lost, unless it was
carried away meanwhile, which is taken to be one in ten."""

_BEST = {
    "set_places": math.inf,
    "known_places": math.inf,
    "set_margin": 1.0,
    "set_evidence": math.inf,
    "rival_evidence": 0.0,
    "kin": 1.0,
    "set_distinctive": 2.0,
    "set_seen": math.inf,
    "set_missing": 0.0,
}
_MOST_LOG_ODDS = 30.0


@dataclass(frozen=True, slots=True)
class Weight:
    """One figure's part. described: of all figures, growing with the probability that it is false.

    weight: log-odds per unit of it, never negative. usual: the mean over what was fitted on.
    """

    described: Callable[[Figures], float]
    weight: float
    usual: float

    def log_odds(self, figures: Figures) -> float:
        """What the figure adds to the log-odds that the set is false."""
        return self.weight * (self.described(figures) - self.usual)

    def at_best(self) -> float:
        """The least that it can add."""
        return self.log_odds(_BEST)


def _few(name: str, most: float) -> Callable[[Figures], float]:
    """Of a count: a doubling tells as much anywhere, up to `most`."""
    return lambda figures: -math.log(min(max(figures[name], 1.0), most))


def _rivalled(figures: Figures) -> float:
    return min(figures["rival_evidence"] / max(figures["set_evidence"], 1.0), 1.0)


def _little_seen(figures: Figures) -> float:
    return -math.sqrt(min(1e-3 * figures["set_seen"], 8.0))


WEIGHTS = {
    "set_places": Weight(_few("set_places", 6.0), 0.389, -0.554),
    "known_places": Weight(_few("known_places", 12.0), 0.485, -1.144),
    "set_margin": Weight(lambda f: 1.0 - min(f["set_margin"], 1.0), 0.673, 0.375),
    "rival_evidence": Weight(_rivalled, 2.633, 0.152),
    "kin": Weight(lambda f: -f["kin"], -KIN, 0.0),
    "set_distinctive": Weight(lambda f: 1.0 - 0.5 * f["set_distinctive"], 1.466, 0.427),
    "set_seen": Weight(_little_seen, 1.171, -1.333),
    "set_missing": Weight(lambda f: 20.0 * min(f["set_missing"], 0.1), 7.069, 0.184),
}
"""By the figure's name; a figure that is not measured yet adds nothing."""


def log_odds(figures: Figures) -> float:
    """Log-odds that a set with these figures is false."""
    return PRIOR + math.fsum(w.log_odds(figures) for n, w in WEIGHTS.items() if n in figures)


def probability_false(figures: Figures) -> float:
    """Probability, 0..1, that a set with these figures is false."""
    return _probability(log_odds(figures))


def at_best(figures: Figures) -> float:
    """The same, if what has not been measured were as good as it can be."""
    hoped = math.fsum(w.at_best() for name, w in WEIGHTS.items() if name not in figures)
    return _probability(log_odds(figures) + hoped)


def _probability(odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-min(max(odds, -_MOST_LOG_ODDS), _MOST_LOG_ODDS)))
