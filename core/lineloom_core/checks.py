"""All that a constraint, or a spot where a scan may have been taken, is held to.

A new check is a row here, a figure where the others of its table are measured, and a parameter in
its section of the configuration.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from lineloom_core.check import Check, Checks, Figures
from lineloom_core.join_odds import WEIGHTS

NEAR_SLACK = 1.5
"""How far registration may go beyond the window that was searched, as a multiple of it."""

_DUE, _AT_ONCE = 1.5, 2.0
"""Surprise of a step that was due, and usual intervals that scans come within at once."""


def _beyond_clutter(_: Any, threshold: float, figures: Figures) -> float:
    return threshold + figures["own_conflict"]


def _less_objects(_: Any, threshold: float, figures: Figures) -> float:
    return max(threshold - figures.get("objects", 0.0), 0.0)


def _near_window(_: Any, threshold: float, __: Figures) -> float:
    return NEAR_SLACK * threshold


def _unsupported(config: Any, figures: Figures) -> bool:
    """After a pause the matcher has to be sure of a step, or it is held to more; after a long one
    it is in any case.
    """
    gap = figures.get("gap", 1.0)
    backed = figures.get("backed", 0.0) and gap <= config.farthest_gap
    return gap > config.longest_gap and not backed


def _lead_of_step(config: Any, threshold: float, figures: Figures) -> float:
    gap = figures.get("gap", 1.0)
    if gap > config.farthest_gap and not figures.get("backed", 0.0):
        return math.inf
    return float(config.gap_lead if gap > config.longest_gap else threshold)


def _fit_of_step(config: Any, threshold: float, figures: Figures) -> float:
    return float(config.gap_fit if _unsupported(config, figures) else threshold)


def _conflict_of_step(config: Any, threshold: float, figures: Figures) -> float:
    if _unsupported(config, figures):
        return float(config.gap_conflict)
    noisy = figures.get("noise", 1.0) > config.noisy_above
    return float(config.noisy_conflict if noisy else threshold)


def _cost_of_step(_: Any, threshold: float, figures: Figures) -> float:
    """After a turn of 45 degrees, what lies half a turn off took no larger one."""
    near = figures.get("turn", 0.0) < math.pi / 4.0
    return math.inf if near or figures.get("backed", 0.0) else threshold


def _wall_of_step(_: Any, least: float, figures: Figures) -> float:
    """Half of it is enough where somebody who drives evenly, unseen for no time, was due."""
    due = figures.get("surprise", math.inf) < _DUE and figures.get("gap", 1.0) < _AT_ONCE
    return 0.5 * least if due else least


def _odds(name: str) -> Callable[[Figures], float]:
    return WEIGHTS[name].log_odds


def _alone_if_small(config: Any, least: float, figures: Figures) -> float:
    small = figures["corrected_m"] < config.small_step
    return 0.0 if small and figures["corrected_rad"] < config.small_turn else least


_SHOWN = (
    Check("fit", "On known surfaces", "share"),
    Check("evidence", "Evidence", "m"),
    Check("conflict", "Points in free space", "points"),
    Check("own_conflict", "Clutter of the places", "share"),
    Check("isotropy", "Least over greatest information"),
)

# fmt: off
TRACKED = Checks("A step from one keyframe to the next", "tracker", (
    Check("fit", "On known surfaces", "share", at_least="least_fit", adjusted=_fit_of_step,
          told="`gap_fit` after a gap that the matcher is not sure of",
          objection="too little of the scan fits"),
    Check("conflict_share", "In free space", "share", at_most="most_conflict",
          adjusted=_conflict_of_step, objection="walls stand in free space",
          told="`noisy_conflict` where the lidar is noisy, `gap_conflict` after such a gap"),
    Check("matched", "Of all the scan on known surfaces", "share", at_least="least_matched",
          objection="too little of the scan lies on anything known"),
    Check("misfit", "What speaks against it", at_most="most_misfit",
          objection="the scan does not fit where it fits best"),
    Check("lead", "Lead over any other spot", at_least="least_lead",
          adjusted=_lead_of_step,
          told="`gap_lead` after a gap; beyond `farthest_gap` only if the matcher is sure",
          objection="another spot fits almost as well"),
    Check("cost", "The same, and how unlike the last steps it is", at_most="most_cost",
          adjusted=_cost_of_step,
          told="none up to a turn of 45 degrees, or where the pairwise matcher is sure of it",
          objection="that all it shows is new would be as likely"),
    Check("wall", "Of what it fits", "m", at_least="least_wall", adjusted=_wall_of_step,
          told="half of it where even steps go on",
          objection="it shows too little wall to be known by"),
    Check("surprise", "Unlike the even steps before it", at_most="most_surprise",
          objection="no robot that drove evenly is there at once"),
    Check("backed", "The pairwise matcher is sure of it"),
    Check("turn", "Turned since the last scan", "rad"),
    Check("gap", "Silence before it, or skipped scans", "intervals"),
    Check("noise", "The robot's noise figure"),
))

NEAR_LOOP = Checks("A near loop", "near_loops", (
    Check("fit", "On known surfaces", "share", at_least="least_fit",
          objection="too little of the scan fits"),
    Check("conflict_share", "In free space", "share", at_most="most_conflict",
          objection="walls stand in free space"),
    Check("moved_m", "Moved by the loop", "m", at_most="reach_xy", adjusted=_near_window,
          told=f"{NEAR_SLACK:g} times", objection="it is not where the graph predicted it"),
    Check("turned_rad", "Turned by the loop", "rad", at_most="reach_theta", adjusted=_near_window,
          told=f"{NEAR_SLACK:g} times", objection="it is not turned as the graph predicted it"),
))

RECOGNISED = Checks("A place recognised in another", "recognition", (
    Check("matched", "Points in common", "points", at_least="least_matched",
          objection="too few points in common"),
    Check("overlap", "Common wall", "m", at_least="least_overlap", adjusted=_less_objects,
          told="less a metre for each object in common",
          objection="too little common line length"),
    Check("objects", "Columns and the like in common", "objects"),
    Check("conflict_share", "In free space", "share", at_most="most_conflict",
          adjusted=_beyond_clutter, told="beyond the places' own clutter",
          objection="walls of one place stand in free space of the other"),
    Check("margin", "Lead over the runner-up", "share", at_least="least_margin",
          objection="another hypothesis fits almost as well"),
    Check("information", "Information on the position", "1/m²", at_least="least_information",
          objection="the position along one direction is not determined"),
    Check("missing_share", "Missing of what stood still", "share", at_most="most_missing",
          objection="what stood still in one place is missing in the other"),
    *_SHOWN,
))

WIDE_LOOP = Checks("A wide loop", "wide_loops", (
    Check("drift_sigmas", "Correction over the drift", "σ", at_most="most_sigmas",
          objection="farther off than the drift allows"),
    Check("agreeing", "Others that correct the graph alike", "constraints",
          at_least="least_agreeing", adjusted=_alone_if_small,
          told="none up to `small_step` and `small_turn`",
          objection="waiting for others that agree"),
    Check("corrected_m", "Correction of the position", "m"),
    Check("corrected_rad", "Correction of the heading", "rad"),
))

JOINED = Checks("A set of recognitions that joins two components", "join", (
    Check("set_size", "Constraints that agree", "constraints", at_least="least_set",
          objection="too few constraints agree"),
    Check("set_evidence", "Their evidence", "m", at_least="least_evidence",
          objection="too little evidence in all"),
    Check("set_places", "Places of either that they rest on", "places",
          objection="they rest on few places", weighed=_odds("set_places")),
    Check("known_places", "Places of the smaller component", "places",
          objection="little is known of one component", weighed=_odds("known_places")),
    Check("set_margin", "Their lead over runners-up", "share",
          objection="other hypotheses fit almost as well", weighed=_odds("set_margin")),
    Check("rival_evidence", "Evidence of a rival set", "m",
          objection="another set of constraints says something else",
          weighed=_odds("rival_evidence")),
    Check("kin", "Of one robot, in one session", weighed=_odds("kin")),
    Check("set_distinctive", "Of them, from places unlike others", "constraints",
          at_least="least_distinctive",
          objection="the places look like others of the same robots",
          weighed=_odds("set_distinctive")),
    Check("set_seen", "Seen by both of what stood still", "points",
          objection="little was seen by both", weighed=_odds("set_seen")),
    Check("set_missing", "Missing over all of them", "share", at_most="most_missing",
          objection="what stood still for one is missing for the other ({0:.1%})",
          weighed=_odds("set_missing")),
    Check("map_missing", "Missing wherever the maps overlap", "share", at_most="most_map_missing",
          objection="the maps contradict each other there ({0:.1%})"),
    Check("doubt", "Probability that they are false", "share", at_most="most_false",
          objection="it may be false ({0:.1%})"),
))

DOUBTED = Checks("What was believed, when more is known", "doubt", (
    Check("jump_missing", "Gone from before the step to after it", "share", at_most="jump_missing",
          objection="the robot jumped here, {0:.1%} of what stood still is gone"),
    Check("slip_missing", "Missing since the track was right", "share", at_most="place_wrong",
          objection="tracking slipped hereabouts, {0:.1%} of what stood still is "
          "missing"),
    Check("pair_missing", "Missing between the two tracks", "share", at_most="most_missing",
          objection="{0:.1%} of what stood still for one is missing for the other"),
    Check("strain_m", "Off in the solved graph", "m", at_most="most_strain",
          objection="the graph contradicts it"),
    Check("strain_rad", "Turned in the solved graph", "rad", at_most="most_turn",
          objection="the graph contradicts it"),
))

SAID = Checks("An operator's join", "recognition", (
    Check("snapped_m", "Moved by the matcher", "m"),
    Check("snapped_rad", "Turned by the matcher", "rad"),
))

LOCALISED = Checks("A spot where a scan may have been taken", "localise", (
    Check("matched", "Points in common", "points", at_least="least_matched",
          objection="too little of what was seen is known"),
    Check("explained", "Explained of what was seen", "share", at_least="least_explained",
          objection="too little of what was seen is known"),
    Check("conflict_share", "In free space", "share", at_most="most_conflict",
          adjusted=_beyond_clutter, told="beyond the clutter of both",
          objection="even where it fits best, free space contradicts it"),
    Check("margin", "Lead over the runner-up", "share", at_least="least_margin",
          objection="another spot fits almost as well"),
    Check("information", "Information on the position", "1/m²", at_least="least_information",
          objection="the position along one direction is not determined"),
    Check("places", "Places known around it", "places", at_least="least_places",
          objection="too little of the building is known to tell what else looks like it"),
    *_SHOWN,
))
# fmt: on

TABLES = (TRACKED, NEAR_LOOP, RECOGNISED, WIDE_LOOP, JOINED, DOUBTED, SAID, LOCALISED)
