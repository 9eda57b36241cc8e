"""Parameters of the thesis's matcher: the error windows and the numbers the text leaves open."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True, slots=True)
class PrimitiveConfig:
    """How chapter 3's primitives are extracted; metres and radians.

    sigma: range noise of the sensor (SICK LMS: +-2.5 cm at most, §6.1). split: Algorithm 1's
    threshold t. merge_factor: neighbours are collinear when their joint deviation stays below
    merge_factor * split. break_angle: flattest incidence still taken for one surface (0 starts
    Algorithm 1 with all points in one set, as printed). min_points, min_length: what a line
    segment must have. max_gap: widest hole in a surface that a merge may bridge [m].
    corner_gap: beams that may lie between two lines that meet in an angle edge; corner_reach:
    how far their intersection may lie from either end; least_angle: flattest intersection that
    is one. virtual_edges: form them (§3.3).
    """

    sigma: float = 0.015
    split: float = 0.065
    merge_factor: float = 0.8
    break_angle: float = math.radians(8.0)
    min_points: int = 5
    min_length: float = 0.2
    max_gap: float = 0.3
    corner_gap: int = 3
    corner_reach: float = 0.35
    least_angle: float = math.radians(15.0)
    virtual_edges: bool = False


@dataclass(frozen=True, slots=True)
class Windows:
    """The bounding error windows within which two parameters are equal (§4.4, §6.3.1).

    angle [rad] and distance [m] are the text's 5 degrees and 10 cm. length: for complete line
    segments [m], more because either end may be a beam's spacing off. least_edge_distance: edges
    closer than this have no direction from one to the other [m]. corners_bind_lines: lines that
    end in corners that differ cannot match (§4.1.2).
    """

    angle: float = math.radians(5.0)
    distance: float = 0.10
    length: float = 0.15
    least_edge_distance: float = 0.3
    corners_bind_lines: bool = False


@dataclass(frozen=True, slots=True)
class ThesisConfig:
    """Parameters of chapters 3 to 5.

    lines: "chapter 3", or "features" for the extraction of the default matcher, to compare.
    threshold: Algorithm 5's least merged score. both_orders: compare a relation (k, m) with
    (u, v) and (v, u); False as printed, where extraction numbers always ascend. order_extension:
    §5.7, Algorithm 10 instead of 7. discard: drop pairs that contradict the others after the
    alignment (see `alignment`). rivals: how many further first maxima are followed, to learn
    whether the answer is unique; backtrack: prefer a rival whose score is greater (the text never
    does). least_margin: lead over the rivals that an unambiguous answer has. most_spread: how far
    the translations of single edges may lie from their mean, rms [m]. least_pairs, least_score:
    what a "match" must have; least_share: share of the scores that a "weak" answer of fewer
    pairs must have.
    """

    primitives: PrimitiveConfig = field(default_factory=PrimitiveConfig)
    windows: Windows = field(default_factory=Windows)
    lines: Literal["chapter 3", "features"] = "chapter 3"
    threshold: float = 0.5
    both_orders: bool = False
    order_extension: bool = False
    rivals: int = 2
    backtrack: bool = False
    discard: bool = True
    least_margin: float = 0.15
    most_spread: float = 0.3
    least_pairs: int = 3
    least_score: float = 0.5
    least_share: float = 0.4
