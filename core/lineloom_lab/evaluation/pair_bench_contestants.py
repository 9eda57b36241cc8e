"""Who takes part in the benchmark of pairwise matchers, by name."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeVar, cast, runtime_checkable

from lineloom_core.geometry import Pose
from lineloom_core.matching import LineMatcher, Matcher
from lineloom_core.matching.result import MatchResult

from lineloom_lab import baselines as b

Kind = Literal["default", "thesis", "baseline", "peer"]
Start = Literal["none", "identity", "guess"]

Prepared_contra = TypeVar("Prepared_contra", contravariant=True)


@runtime_checkable
class GuidedMatcher(Protocol[Prepared_contra]):
    """A matcher that needs a guess; as a pose-free one it starts from identity."""

    def match_from(
        self, reference: Prepared_contra, current: Prepared_contra, guess: Pose
    ) -> MatchResult:
        """Find T_reference_current starting from `guess`."""


@dataclass(frozen=True, slots=True)
class Contestant:
    """A matcher to be. name: as its own `name`. make: raises ImportError if it is not installed.

    starts: "none" for a matcher that needs no guess; those that need one are run twice, from
    identity and from a good guess, and are no pose-free matchers the second time.
    """

    name: str
    kind: Kind
    make: Callable[[], Matcher[Any]]
    starts: tuple[Start, ...] = ("none",)


_GUIDED: tuple[Start, ...] = ("identity", "guess")


def _thesis() -> Matcher[Any]:
    """Make the thesis's matcher; raises ImportError where this version has none."""
    module = importlib.import_module("lineloom_core.matching.thesis")
    if not hasattr(module, "ThesisMatcher"):
        raise ImportError("lineloom_core.matching.thesis has no ThesisMatcher")
    return cast("Matcher[Any]", module.ThesisMatcher())


def _peer(class_name: str) -> Callable[[], Matcher[Any]]:
    def make() -> Matcher[Any]:
        peers = importlib.import_module("lineloom_lab.evaluation.peers")
        return cast("Matcher[Any]", getattr(peers, class_name)())

    return make


CONTESTANTS: tuple[Contestant, ...] = (
    Contestant("lineloom", "default", LineMatcher),
    Contestant("thesis", "thesis", _thesis),
    Contestant("point-to-line", "baseline", b.PointToLineMatcher, _GUIDED),
    Contestant("idc", "baseline", b.IdcMatcher, _GUIDED),
    Contestant("angle-histogram", "baseline", b.AngleHistogramMatcher),
    Contestant("common-subgraph", "baseline", b.CommonSubgraphMatcher),
    Contestant("complete-lines", "baseline", b.CompleteLinesMatcher),
    Contestant("angle-only", "baseline", b.AngleOnlyMatcher),
    Contestant("geometric-hashing", "baseline", b.GeometricHashingMatcher),
    Contestant("open3d-fpfh-ransac", "peer", _peer("Open3dMatcher")),
    Contestant("kiss-matcher", "peer", _peer("KissMatcherMatcher")),
    Contestant("karto", "peer", _peer("KartoMatcher"), _GUIDED),
    Contestant("small-gicp", "peer", _peer("SmallGicpMatcher"), _GUIDED),
)
_KINDS: dict[str, Kind] = {"baselines": "baseline", "peers": "peer"}


def choices() -> tuple[str, ...]:
    """Return every word that `chosen` understands."""
    return ("all", *_KINDS, *(c.name for c in CONTESTANTS))


def chosen(names: Sequence[str]) -> tuple[Contestant, ...]:
    """Return the contestants by name, or "all", "baselines", "peers"; in their fixed order.

    Raises ValueError for a name that nobody has.
    """
    unknown = [name for name in names if name not in choices()]
    if unknown:
        raise ValueError(f"no matcher {unknown[0]!r}; there are {', '.join(choices())}")
    kinds = {_KINDS[name] for name in names if name in _KINDS}
    return tuple(c for c in CONTESTANTS if "all" in names or c.name in names or c.kind in kinds)
