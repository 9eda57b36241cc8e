"""Matching scans without any pose."""

from lineloom_core.matching.interface import Matcher, match
from lineloom_core.matching.matcher import LineMatcher, MatcherConfig
from lineloom_core.matching.result import Alternative, LinePair, MatchResult, Verdict

__all__ = [
    "Alternative",
    "LineMatcher",
    "LinePair",
    "MatchResult",
    "Matcher",
    "MatcherConfig",
    "Verdict",
    "match",
]
