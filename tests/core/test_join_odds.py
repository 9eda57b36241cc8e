"""One probability that a set is false: its parts, their signs, and what is said to be lacking."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from lineloom_core.checks import JOINED
from lineloom_core.join_odds import PRIOR, WEIGHTS, at_best, log_odds, probability_false
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.merging.weighing import lacking

GOOD = {
    "set_size": 6.0, "set_places": 4.0, "known_places": 8.0, "set_evidence": 300.0,
    "set_margin": 0.9, "rival_evidence": 0.0, "kin": 0.0,
    "set_distinctive": 2.0, "set_seen": 6000.0, "set_missing": 0.001, "map_missing": 0.001,
}  # fmt: skip
WORSE = {
    "set_places": 1.0, "known_places": 1.0, "set_seen": 300.0,
    "set_margin": 0.2, "rival_evidence": 200.0, "set_distinctive": 0.0,
    "set_missing": 0.05,
}  # fmt: skip
DEAR = ("set_distinctive", "set_missing", "set_seen")


def drawn(rng: np.random.Generator) -> dict[str, float]:
    """Figures anywhere between good and bad."""
    share = {name: rng.uniform() for name in GOOD}
    return {n: (1.0 - share[n]) * v + share[n] * WORSE.get(n, v) for n, v in GOOD.items()}


def test_the_parts_that_are_shown_make_the_sum() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        figures = drawn(rng)
        figures["doubt"] = probability_false(figures)
        limits = JOINED.limits(MapperConfig().join, figures)
        parts = [limit.log_odds for limit in limits.values() if limit.log_odds is not None]
        assert len(parts) == len(WEIGHTS)
        logit = math.log(figures["doubt"] / (1.0 - figures["doubt"]))
        assert PRIOR + sum(parts) == pytest.approx(logit)


@pytest.mark.parametrize("name", WORSE)
def test_no_figure_that_is_worse_makes_it_more_probable(name: str) -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        figures = drawn(rng)
        better, worse = {**figures, name: GOOD[name]}, {**figures, name: WORSE[name]}
        assert log_odds(better) <= log_odds(worse) + 1e-12


def test_every_weight_has_the_sign_that_reason_gives_it() -> None:
    assert min(w.weight for w in WEIGHTS.values()) >= 0.0
    assert log_odds({**GOOD, "kin": 1.0}) < log_odds(GOOD)


def test_what_is_not_measured_is_hoped_for_and_never_claimed() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        figures = drawn(rng)
        at_once = {n: v for n, v in figures.items() if n not in DEAR}
        assert at_best(at_once) <= probability_false(figures) + 1e-12
        assert at_best(at_once) <= probability_false(at_once)
        assert at_best(figures) == probability_false(figures)


def test_as_much_more_wall_as_is_said_to_be_lacking_is_enough() -> None:
    most, said = MapperConfig().join.most_false, 0
    for evidence in np.geomspace(20.0, 300.0, 25).tolist():
        times = evidence / 300.0
        growing = ("set_size", "set_places", "known_places", "set_evidence", "set_seen")
        figures = {n: v * times if n in growing else v for n, v in GOOD.items()}
        if probability_false(figures) <= most:
            continue
        found = re.fullmatch(r"(\d+) m more of common wall", lacking(most, figures))
        if found is None:
            continue
        said += 1
        more = (evidence + float(found[1])) / evidence
        enough = {n: v * more if n in growing else v for n, v in figures.items()}
        assert probability_false(enough) <= most
        half = {
            n: v * (1.0 + 0.5 * (more - 1.0)) if n in growing else v for n, v in figures.items()
        }
        assert probability_false(half) > most
    assert said > 3


@pytest.mark.parametrize(
    ("figures", "words"),
    [
        ({"rival_evidence": 290.0}, "another set of constraints says something else"),
        ({"set_distinctive": 0.0}, "the places look like others of the same robots"),
        ({"set_missing": 0.03}, "what stood still for one is missing for the other (3.0%)"),
    ],
)
def test_what_more_of_the_same_would_not_mend_is_named(
    figures: dict[str, float], words: str
) -> None:
    assert lacking(1e-9, {**GOOD, **figures}) == words
