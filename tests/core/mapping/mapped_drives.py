"""What two drives come to, as plain values: `python -m tests.core.mapping.mapped_drives OUT`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.scan import Scan
from lineloom_lab.simulation import Fleet, rooms, sick_lms200

from tests.core.mapping.test_kidnapped import carried_from_a_corner
from tests.scenarios.real_logs import CSAIL

_PIECE = 300
"""Scans of MIT CSAIL: its first 40 m or so."""


def drives() -> dict[str, list[tuple[str, Scan]]]:
    """A fleet that merges, a robot that is carried unseen, and a piece of a real log."""
    fleet = Fleet.touring(rooms(2), robots=2, seed=2, duration_s=40.0, lidar=sick_lms200())
    carried, _ = carried_from_a_corner(2, sick_lms200(), 0)
    found = {
        "fleet": [(s.robot, s.scan) for s in fleet.scans()],
        "carried": [(s.robot, s.scan) for s in carried],
    }
    if CSAIL.log.is_file():
        found["csail"] = [("r", scan) for scan in CSAIL.read()[:_PIECE]]
    return found


def mapped(scans: Iterable[tuple[str, Scan]]) -> dict[str, Any]:
    """Verdicts (constraints by the scans they tie, with state; joins) and poses of a drive."""
    mapper, withdrawn = SiteMapper(), 0
    for robot, scan in scans:
        withdrawn += len(mapper.add(robot, scan).withdrawn)
    view = mapper.view()
    scan_of = {k.id: [k.robot, k.session, k.seq] for k in view.keyframes}
    return {
        "components": len(view.components),
        "withdrawn": withdrawn,
        "verdicts": sorted(
            [c.kind, c.state, scan_of[c.keyframe_a], scan_of[c.keyframe_b]]
            for c in view.constraints
        ),
        "poses": {robot: t.poses.tolist() for robot, t in view.trajectories.items()},
    }


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(json.dumps({name: mapped(s) for name, s in drives().items()}))
