"""What every pairwise matcher of this package offers: the default, the thesis's, the baselines."""

from __future__ import annotations

from typing import Protocol, TypeVar

from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan

Prepared = TypeVar("Prepared")


class Matcher(Protocol[Prepared]):
    """Matches two scans without any pose.

    `prepare` does what depends on one scan alone (extraction), `match_prepared` the rest, so that
    a scan that is matched many times is prepared once and benchmarks can tell the two apart.
    """

    @property
    def name(self) -> str:
        """Short name for tables."""

    def prepare(self, scan: Scan) -> Prepared:
        """Extract what this matcher needs of one scan."""

    def match_prepared(self, reference: Prepared, current: Prepared) -> MatchResult:
        """Find T_reference_current; "none" with a reason where there is nothing to find."""


def match(matcher: Matcher[Prepared], reference: Scan, current: Scan) -> MatchResult:
    """Prepare and match two scans."""
    return matcher.match_prepared(matcher.prepare(reference), matcher.prepare(current))
