"""What follows a robot: Lineloom's own tracker, or the thesis's matcher alone."""

from __future__ import annotations

from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.facts.thesis_tracker import ThesisTracker
from lineloom_core.mapping.facts.tracker import Tracker

AnyTracker = Tracker | ThesisTracker
"""Both place scans by `track`, and say their `turn_rate`."""


def new_tracker(config: MapperConfig) -> AnyTracker:
    """Return the tracker of a track that begins, as `matcher` says."""
    made = ThesisTracker if config.matcher == "thesis" else Tracker
    return made(config.tracker)
