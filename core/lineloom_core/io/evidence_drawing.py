"""A constraint's evidence as a picture: both places laid on each other, conflicts in red."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lineloom_core.check import Limit
from lineloom_core.io.drawing import FRAME, INK, MUTED, Box, Disc, Drawing, Label, Mark, Strokes
from lineloom_core.mapping.answers.evidence import Evidence
from lineloom_core.mapping.answers.site_view import ConstraintView

REFERENCE, CURRENT, CONFLICT, MATCHED = "#0072b2", "#d55e00", "#c81e1e", "#009e73"

_WIDTH = 1100.0
_PICTURE = 720.0  # px: the square on the left
_PAD = 24.0
_ROW = 22.0
_FONT = 14.0
_NAMELESS = Limit(None, None, True)


def draw_evidence(constraint: ConstraintView, evidence: Evidence) -> Drawing:
    """Return both places in the frame of keyframe a, and every figure beside its threshold.

    Lines of the reference are blue, those of the current place orange, those taken for one wall
    thick and green; points of one in free space of the other are red.
    """
    place = _Placement(evidence)
    marks: list[Mark] = [Box(_PAD, _PAD, _PICTURE, _PICTURE, FRAME)]
    for pair in evidence.matched:
        both = np.array([pair.reference, pair.current])
        marks.append(Strokes(place.lines(both), MATCHED, 7.0, 0.35))
    marks.append(Strokes(place.lines(evidence.reference), REFERENCE, 2.0))
    marks.append(Strokes(place.lines(evidence.current), CURRENT, 2.0))
    for x, y in place.points(evidence.conflicts):
        marks.append(Disc(x, y, 2.5, CONFLICT, CONFLICT, 0.5))
    marks.extend(_legend(evidence))
    marks.extend(_figures(constraint, evidence))
    title = f"{constraint.kind} {constraint.id}: {constraint.state}"
    description = (
        f"{constraint.reason}. {len(evidence.matched)} matched lines, "
        f"{len(evidence.conflicts)} points in conflict."
    )
    height = _PICTURE + 2.0 * _PAD + 2.0 * _ROW
    return Drawing(_WIDTH, height, title, description, tuple(marks))


class _Placement:
    """Metres to pixels: everything that is shown fits the square."""

    def __init__(self, evidence: Evidence) -> None:
        ends = np.concatenate(
            [evidence.reference.reshape(-1, 2), evidence.current.reshape(-1, 2), np.zeros((1, 2))]
        )
        low, high = ends.min(axis=0), ends.max(axis=0)
        self._middle = 0.5 * (low + high)
        self._scale = (_PICTURE - 2.0 * _PAD) / max(float((high - low).max()), 1.0)

    def points(self, xy: NDArray[np.float64]) -> list[tuple[float, float]]:
        """Points (n, 2) on the page, y down."""
        at = _PAD + 0.5 * _PICTURE + self._scale * (xy - self._middle) * (1.0, -1.0)
        return [(float(x), float(y)) for x, y in at]

    def lines(self, ends: NDArray[np.float64]) -> tuple[tuple[tuple[float, float], ...], ...]:
        """Lines (n, 4) on the page."""
        at = self.points(ends.reshape(-1, 2))
        return tuple((at[i], at[i + 1]) for i in range(0, len(at), 2))


def _legend(evidence: Evidence) -> list[Mark]:
    y = _PICTURE + _PAD + _ROW
    entries = (
        (REFERENCE, "reference"),
        (CURRENT, "current"),
        (MATCHED, f"{len(evidence.matched)} taken for one wall"),
        (CONFLICT, f"{len(evidence.conflicts)} points in the other's free space"),
    )
    marks: list[Mark] = []
    x = _PAD
    for colour, text in entries:
        marks.append(Disc(x + 5.0, y - 5.0, 5.0, colour, colour))
        marks.append(Label(x + 16.0, y, text, _FONT, INK))
        x += 40.0 + 7.8 * len(text)
    return marks


def _figures(constraint: ConstraintView, evidence: Evidence) -> list[Mark]:
    x, y = _PICTURE + 2.0 * _PAD, _PAD + _ROW
    marks: list[Mark] = [
        Label(x, y, f"{constraint.kind} {constraint.id}", 1.2 * _FONT, INK),
        Label(x, y + _ROW, constraint.state, _FONT, INK),
        Label(x, y + 2.0 * _ROW, _shortened(constraint.reason), _FONT, MUTED),
    ]
    y += 4.0 * _ROW
    for name, value in constraint.checks.items():
        limit = evidence.limits.get(name, _NAMELESS)
        text = f"{limit.means or name}: {_written(value, limit)}{_bound(limit)}"
        marks.append(Label(x, y, text, _FONT, INK if limit.holds else CONFLICT))
        y += _ROW
    if evidence.votes is not None:
        marks.append(Label(x, y, f"votes: {evidence.votes:.3g} m of line", _FONT, INK))
        y += _ROW
    if evidence.runner_up is not None:
        text = f"runner-up: {evidence.runner_up.evidence:.3g} m of wall"
        marks.append(Label(x, y, text, _FONT, INK))
    return marks


def _written(value: float, limit: Limit) -> str:
    if limit.unit == "share":
        return f"{value:.1%}"
    unit = "" if len(limit.unit) > 4 else limit.unit  # what is counted is in the words
    return f"{value:.3g} {unit}".rstrip()


def _bound(limit: Limit) -> str:
    bounds = (("≥", limit.at_least), ("≤", limit.at_most))
    parts = [f"{way} {_written(bound, limit)}" for way, bound in bounds if bound is not None]
    return f"  ({', '.join(parts)})" if parts else ""


def _shortened(text: str) -> str:
    return text if len(text) <= 44 else f"{text[:43]}…"
