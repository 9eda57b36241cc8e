"""The map as a geometric map of IEEE 1873-2015 (robot map data representation), in XML.

A line segment is (rho, alpha, psi_a, psi_b): the line at distance rho >= 0 from the origin, alpha
the direction of its normal, psi_a and psi_b the end points' coordinates along the line, counted
from the foot of the normal, counter-clockwise positive; with the 4x4 covariance of these.

The standard's schema is not public. Names of elements and attributes follow what its authors have
published (Amigoni and others, IEEE Robotics & Automation Magazine, March 2018); where that is
silent (the names around the segments, the namespace) they are ours. So this file has not been
checked against the schema: see core/docs/formats.md.
"""

from __future__ import annotations

import math
from itertools import combinations_with_replacement
from xml.etree import ElementTree as ET

from lineloom_core.io.selection import BBox, ComponentContent, select
from lineloom_core.mapping.answers.site_view import MapLine, SiteView

_PARAMETERS = ("rho", "alpha", "psi_a", "psi_b")
_END_SIGMA_M = 0.1
"""How far a wall's end may lie from where it was last seen: lines are cut by occlusion."""


def write_map(
    view: SiteView, component: str | None = None, bbox: BBox | None = None, site: str = "site"
) -> str:
    """Return one geometric map per component, as an XML document.

    Metres and radians, in each component's own frame. Raises as `selection.select` does.
    """
    contents = select(view, component, bbox)
    root = ET.Element("map_group", {"name": site, "version": str(view.version)})
    for content in contents:
        root.append(_geometric_map(content, view.version))
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, "unicode") + "\n"


def polar(line: MapLine) -> tuple[float, float, float, float]:
    """Return rho, alpha, psi_a, psi_b of a line."""
    length = math.hypot(line.x2 - line.x1, line.y2 - line.y1)
    dx, dy = (1.0, 0.0)
    if length > 0.0:
        dx, dy = (line.x2 - line.x1) / length, (line.y2 - line.y1) / length
    rho, alpha = line.x1 * dy - line.y1 * dx, math.atan2(-dx, dy)
    if rho < 0.0:
        rho, alpha = -rho, math.atan2(dx, -dy)
    c, s = math.cos(alpha), math.sin(alpha)
    return rho, alpha, line.y1 * c - line.x1 * s, line.y2 * c - line.x2 * s


def _geometric_map(content: ComponentContent, version: int) -> ET.Element:
    identity = content.component.id
    local = ET.Element("local_map", {"id": identity, "type": "geometric"})
    metadata = ET.SubElement(local, "metadata")
    ET.SubElement(metadata, "name").text = identity
    ET.SubElement(metadata, "version").text = str(version)
    ET.SubElement(metadata, "description").text = (
        "walls seen by " + ", ".join(content.component.robots) + "; free side left of a to b"
    )
    ET.SubElement(local, "coordinate_system", {"type": "cartesian", "length": "m", "angle": "rad"})
    segments = ET.SubElement(local, "line_segments")
    for line in content.lines:
        segments.append(_segment(line))
    return local


def _segment(line: MapLine) -> ET.Element:
    values = dict(zip(_PARAMETERS, (repr(v + 0.0) for v in polar(line)), strict=True))
    length = math.hypot(line.x2 - line.x1, line.y2 - line.y1)
    turn = line.sigma * math.sqrt(12.0) / max(length, line.sigma * math.sqrt(12.0), 1e-6)
    variances = {
        "rho": line.sigma**2,
        "alpha": turn**2,
        "psi_a": _END_SIGMA_M**2,
        "psi_b": _END_SIGMA_M**2,
    }
    covariance = {
        f"covariance_{a}{b}": repr(variances[a] if a == b else 0.0)
        for a, b in combinations_with_replacement(_PARAMETERS, 2)
    }
    return ET.Element("line_segment", {"id": line.id, **values, **covariance})
