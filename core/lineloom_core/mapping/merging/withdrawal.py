"""Taking back what was believed, with the figure that speaks against it."""

from __future__ import annotations

from collections.abc import Mapping

from lineloom_core.checks import DOUBTED
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.site_map import SiteMap


def is_doubted(site: SiteMap, figures: Mapping[str, float]) -> bool:
    """Whether one of the figures speaks against what was believed."""
    return DOUBTED.against(site.config.doubt, figures) is not None


def withdrawn(site: SiteMap, c: Constraint, figures: Mapping[str, float]) -> Constraint:
    """The constraint, taken back for what the figures say."""
    reason = f"withdrawn: {DOUBTED.objection(site.config.doubt, figures)}"
    return c.with_figures(figures).moved_to("retracted", reason, site.now)
