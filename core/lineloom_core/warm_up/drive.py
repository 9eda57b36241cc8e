"""A short made-up drive, which calls every kernel of mapping."""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.fusion.occupancy import rasterise
from lineloom_core.kernels import folders
from lineloom_core.kernels.compilations import compilations
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.matching import LineMatcher
from lineloom_core.scan import Scan


def warm_up() -> bool:
    """Run a short made-up drive through mapper and matcher; a minute without a cache, else less.

    Returns whether anything had to be compiled and is kept: the compiler has some 300 MB for as
    long as its process runs, and another one, that finds all in the cache, does without.
    """
    with compilations() as compiled:
        drive()
    return bool(compiled) and folders.can_keep()


def drive() -> None:
    """Map three robots in a made-up corridor, draw it, and match a pair."""
    mapper = SiteMapper()
    scans = [_room_scan(x, seq) for seq, x in enumerate(np.arange(0.0, 11.0, 0.45))]
    for scan in scans:
        mapper.add("a", scan)
        mapper.add("b", scan)
    for scan in (*scans[:3], scans[15]):  # after a pause a step is searched for
        mapper.add("c", scan)
    view = mapper.view()
    rasterise(mapper.rays(view.components[0].id), np.array([[0.0, 0.0, 1.0, 1.0]]))
    LineMatcher().match(scans[0], scans[2])
    mapper.localise(scans[3:5])


def _room_scan(x: float, seq: int) -> Scan:
    """A half-turn sweep in a 20 m x 6 m room with a pillar every 3 m, from (x + 2, 2)."""
    angles = np.linspace(-math.pi / 2, math.pi / 2, 181)
    c, s = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):
        ranges = np.minimum((18.0 - x) / np.maximum(c, 1e-9), np.where(s > 0, 4.0, 2.0) / abs(s))
    stamps = 0.45 * seq
    comb = (x + ranges * c) % 3.0
    ranges = np.where(comb < 0.8, ranges * 0.93, ranges)
    return Scan.checked(
        np.minimum(ranges, 29.0),
        angle_min=float(angles[0]),
        angle_increment=math.pi / 180,
        range_min=0.05,
        range_max=30.0,
        stamp=stamps,
        seq=seq,
    )
