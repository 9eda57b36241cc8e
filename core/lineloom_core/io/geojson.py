"""The map as GeoJSON (RFC 7946 in form; in local metres, and it says so).

RFC 7946 knows longitude and latitude only. So `coordinates` says in words what the numbers are,
and `coordRefSys` says it as OGC Features and Geometries JSON (JSON-FG) does: a local engineering
frame, with each geometry in `place` as well as, for plain readers, in `geometry`.
"""

from __future__ import annotations

import json
from typing import Any

from lineloom_core.io.selection import BBox, ComponentContent, select
from lineloom_core.mapping.answers.site_view import MapLine, SiteView

_NOTE = (
    "Coordinates are metres in the map frame of the feature's component, x forward, y left; "
    "they are not longitude and latitude. Frames of different components are unrelated."
)
_CORE = "http://www.opengis.net/spec/json-fg-1/1.0/conf/core"
_LOCAL_METRES = "urn:lineloom:crs:local-metres"
"""A name of our own: no authority has one for a frame that hangs on a robot's first scan."""
_DECIMALS = 4  # a tenth of a millimetre


def write_map(
    view: SiteView, component: str | None = None, bbox: BBox | None = None, site: str = ""
) -> str:
    """Return `map_features` as text."""
    return json.dumps(map_features(view, component, bbox), separators=(",", ":"))


def map_features(
    view: SiteView, component: str | None = None, bbox: BBox | None = None
) -> dict[str, Any]:
    """Return a FeatureCollection of walls, trajectories and robots, ready for `json.dumps`.

    properties.kind: "wall" (LineString, free side on the left), "trajectory" (LineString per
    unbroken piece) or "robot" (Point, latest pose). With a bbox whole walls that touch it and the
    stretches of trajectory inside. Raises as `selection.select` does.
    """
    contents = select(view, component, bbox)
    features = [feature for content in contents for feature in _features(content)]
    collection: dict[str, Any] = {
        "type": "FeatureCollection",
        "conformsTo": [_CORE],
        "coordRefSys": _LOCAL_METRES,
        "coordinates": {"frame": "local", "unit": "metre", "note": _NOTE},
        "version": view.version,
        "components": [
            {"id": c.component.id, "robots": list(c.component.robots)} for c in contents
        ],
        "features": features,
    }
    if bbox is not None:
        collection["bbox"] = list(bbox)
    return collection


def _features(content: ComponentContent) -> list[dict[str, Any]]:
    component = content.component.id
    walls = [_wall(line) for line in content.lines]
    paths = [
        _feature(
            "LineString",
            path.poses[:, :2].tolist(),
            {
                "kind": "trajectory",
                "robot": path.robot,
                "session": path.session,
                "component": component,
            },
        )
        for path in content.paths
        if path.poses.shape[0] > 1  # RFC 7946: a LineString has two positions or more
    ]
    robots = []
    for robot in content.robots:
        assert robot.pose is not None
        where = {"kind": "robot", "robot": robot.robot, "component": component}
        state = {"state": robot.state, "theta": robot.pose.theta}
        robots.append(_feature("Point", [robot.pose.x, robot.pose.y], where | state))
    return walls + paths + robots


def _wall(line: MapLine) -> dict[str, Any]:
    properties = {
        "kind": "wall",
        "id": line.id,
        "component": line.component,
        "sigma": line.sigma,
        "support": line.support,
        "robots": list(line.robots),
        "first_seen": line.first_seen,
        "last_seen": line.last_seen,
    }
    return _feature("LineString", [[line.x1, line.y1], [line.x2, line.y2]], properties, line.id)


def _feature(
    geometry: str, coordinates: list[Any], properties: dict[str, Any], name: str | None = None
) -> dict[str, Any]:
    shape = {"type": geometry, "coordinates": _rounded(coordinates)}
    feature: dict[str, Any] = {
        "type": "Feature",
        "geometry": shape,
        "place": shape,
        "properties": properties,
    }
    return feature if name is None else {"id": name, **feature}


def _rounded(value: Any) -> Any:
    if isinstance(value, list):
        return [_rounded(v) for v in value]
    return round(value, _DECIMALS) + 0.0  # no -0.0
