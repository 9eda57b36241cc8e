"""What a figure is held to: rows of the table that mapper, answers, documents and viewer read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable

Figures = Mapping[str, float]
"""What was measured, by the name of its check."""


@storable("limit")
@dataclass(frozen=True, slots=True)
class Limit:
    """What a figure was held to; both bounds None where it is only shown.

    means, unit: of the figure, for whoever shows it. unit: "" for a plain number, "share" for 0..1.
    log_odds: what it adds to those of the constraint being false; None where it is not weighed.
    """

    at_least: float | None
    at_most: float | None
    holds: bool
    means: str = ""
    unit: str = ""
    log_odds: float | None = None


@dataclass(frozen=True, slots=True)
class Check:
    """A figure, what it means, and the parameter that it must come up to or must not go beyond.

    objection: why not, where it speaks against; `{0}` stands for the figure. adjusted: from the
    parameters, the threshold among them, and the other figures to what counts; told: that in words.
    weighed: from all figures to what this one adds to the log-odds that the constraint is false.
    """

    name: str
    means: str
    unit: str = ""
    at_least: str = ""
    at_most: str = ""
    objection: str = ""
    adjusted: Callable[[Any, float, Figures], float] | None = None
    told: str = ""
    weighed: Callable[[Figures], float] | None = None

    def limit(self, config: object, figures: Figures) -> Limit:
        """What the figure is held to under these parameters; it must be there."""
        odds = self.weighed(figures) if self.weighed else None
        if not (self.at_least or self.at_most):
            return Limit(None, None, True, self.means, self.unit, odds)
        threshold = self._threshold(config, figures)
        value = figures[self.name]
        if self.at_least:
            return Limit(threshold, None, value >= threshold, self.means, self.unit, odds)
        return Limit(None, threshold, value <= threshold, self.means, self.unit, odds)

    def fails(self, config: object, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Of many figures at once, whether each speaks against; no other figure may adjust it."""
        threshold = self._threshold(config, {})
        return values < threshold if self.at_least else values > threshold

    def _threshold(self, config: object, figures: Figures) -> float:
        threshold = float(getattr(config, self.at_least or self.at_most))
        if self.adjusted is None:
            return threshold
        return self.adjusted(config, threshold, figures)


@dataclass(frozen=True, slots=True)
class Checks:
    """What one way of judging looks at, in its order; section: of `MapperConfig`, the parameters.

    A figure that was not measured is not judged: what is dear is asked for last.
    """

    title: str
    section: str
    rows: tuple[Check, ...]

    def against(self, config: object, figures: Figures) -> Check | None:
        """The first check that speaks against it, None where none does."""
        for row in self.rows:
            if row.name in figures and not row.limit(config, figures).holds:
                return row
        return None

    def against_each(
        self, config: object, figures: Mapping[str, NDArray[np.float64]]
    ) -> NDArray[np.bool_]:
        """The same for many at once, shape (n,): whether a check speaks against each."""
        failing = [row.fails(config, figures[row.name]) for row in self.rows if row.name in figures]
        against: NDArray[np.bool_] = np.any(failing, axis=0)
        return against

    def objection(self, config: object, figures: Figures) -> str:
        """What speaks against it in words; empty where nothing does."""
        row = self.against(config, figures)
        return "" if row is None else row.objection.format(figures[row.name])

    def limits(self, config: object, figures: Figures) -> dict[str, Limit]:
        """What every figure that is there was held to, by its name."""
        return {r.name: r.limit(config, figures) for r in self.rows if r.name in figures}
