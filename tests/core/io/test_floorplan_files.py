"""Floor plans: the same building from each format, and what is said of broken ones."""

from __future__ import annotations

import contextlib
import io
import json
import math
import random
from typing import Any

import numpy as np
import pytest
from ezdxf import units
from ezdxf.filemanagement import new
from lineloom_core.floorplan.plan import FloorPlan, FloorPlanError
from lineloom_core.io.floorplan_files import PlanFormat, read_plan

ROOM = [[0.0, 0.0, 5.0, 0.0], [5.0, 0.0, 5.0, 3.0], [5.0, 3.0, 0.0, 3.0], [0.0, 3.0, 0.0, 0.0]]
RING = [[0, 0], [5, 0], [5, 3], [0, 3], [0, 0]]


def geojson(geometry: dict[str, Any]) -> bytes:
    feature = {"type": "Feature", "properties": {}, "geometry": geometry}
    return json.dumps({"type": "FeatureCollection", "features": [feature]}).encode()


def dxf(unit: int = units.M, size: float = 1.0) -> bytes:
    document = new("R2010")
    document.units = unit
    block = document.blocks.new("WALLS")
    block.add_lwpolyline([(x * size, y * size) for x, y in RING[:3]])
    space = document.modelspace()
    space.add_blockref("WALLS", (0, 0))
    for x1, y1, x2, y2 in ROOM[2:]:
        space.add_line((x1 * size, y1 * size), (x2 * size, y2 * size))
    space.add_text("Kitchen")
    target = io.StringIO()
    document.write(target)
    return target.getvalue().encode()


def same(plan: FloorPlan) -> bool:
    lines = plan.lines[np.lexsort(plan.lines.T)]
    room = np.array(ROOM)
    return lines.shape == (4, 4) and np.allclose(lines, room[np.lexsort(room.T)], atol=1e-9)


@pytest.mark.parametrize(
    ("content", "format"),
    [
        (b"# a room\n0,0, 5,0\n5 0 5 3\n5,3,0,3\n\n0,3,0,0\n1,1,1,1\n", "text"),
        (geojson({"type": "LineString", "coordinates": RING}), "geojson"),
        (geojson({"type": "Polygon", "coordinates": [RING]}), "geojson"),
        (json.dumps({"type": "MultiLineString", "coordinates": [RING]}).encode(), "geojson"),
        (dxf(), "dxf"),
        (dxf(units.MM, 1000.0), "dxf"),
        (dxf(units.IN, 1.0 / 0.0254), "dxf"),
        (dxf(0), "dxf"),
    ],
)
def test_the_same_room_from_every_format(content: bytes, format: PlanFormat) -> None:
    assert same(read_plan(content, format))


def test_curves_become_chords_that_stay_near() -> None:
    document = new("R2010")
    document.units = units.M
    document.modelspace().add_arc((1.0, 2.0), 4.0, 0.0, 90.0)
    target = io.StringIO()
    document.write(target)
    lines = read_plan(target.getvalue().encode(), "dxf").lines
    middle = 0.5 * (lines[:, :2] + lines[:, 2:]) - [1.0, 2.0]
    assert np.abs(np.hypot(*middle.T) - 4.0).max() <= 0.05
    assert np.hypot(*(lines[:, :2] - lines[:, 2:]).T).sum() == pytest.approx(2.0 * math.pi, 0.01)


@pytest.mark.parametrize(
    ("content", "format", "what"),
    [
        (b"0,0,1\n", "text", "line 1: expected four numbers"),
        (b"0,0,1,1\n0,0,x,1\n", "text", "line 2"),
        (b"0,0,nan,1\n", "text", "line 1: coordinates must be finite"),
        (b"", "text", "no line"),
        (b"\xff\xfe", "text", "not UTF-8"),
        (b"{", "geojson", "not JSON"),
        (b"[]", "geojson", "no GeoJSON object"),
        (b'{"type": "FeatureCollection"}', "geojson", "features: must be a list"),
        (geojson({"type": "Blob"}), "geojson", "features/0/geometry: 'Blob' is no type"),
        (geojson({"type": "LineString", "coordinates": [[0], [1]]}), "geojson", "pairs of numbers"),
        (geojson({"type": "LineString", "coordinates": 7}), "geojson", "must be a list"),
        (geojson({"type": "LineString", "coordinates": [[True, 0], [1, 1]]}), "geojson", "pairs"),
        (geojson({"type": "LineString", "coordinates": [["1", 0], [1, 1]]}), "geojson", "pairs"),
        (geojson({"type": "LineString", "coordinates": [[10**400, 0]]}), "geojson", "pairs"),
        (geojson({"type": "GeometryCollection", "geometries": 5}), "geojson", "must be a list"),
        (b'{"type":"GeometryCollection","geometries":[' * 9, "geojson", "not JSON"),
        (b"[" * 100_000, "geojson", "not JSON"),
        (geojson({"type": ["Blob"]}), "geojson", "is no type"),
        (geojson({"type": "Point", "coordinates": [0, 0]}), "geojson", "no line"),
        (b"0\nSECTION\n", "dxf", "no DXF"),
        (b"hello", "dxf", "no DXF"),
    ],
)
def test_broken_plans_are_told_where(content: bytes, format: PlanFormat, what: str) -> None:
    with pytest.raises(FloorPlanError, match=what):
        read_plan(content, format)


@pytest.mark.parametrize("format", ["dxf", "geojson", "text"])
def test_whatever_is_sent_is_a_plan_or_a_told_error(format: PlanFormat) -> None:
    """Mutations of good files: nothing but FloorPlanError may come out."""
    rng = random.Random(7)
    seeds = {"dxf": dxf(), "text": b"0,0,5,0\n0 1 2 3\n"}
    seed = seeds.get(format, geojson({"type": "Polygon", "coordinates": [RING]}))
    pieces = [b"1e999", b"nan", b"9" * 30, b"\n", b"[", b"{", b"  0\nINSERT\n", b"null"]
    for _ in range(300):
        content = bytearray(seed)
        for _ in range(rng.randint(1, 8)):
            at = rng.randrange(len(content) + 1)
            if rng.random() < 0.5:
                content[at : at + rng.randint(1, 30)] = bytes([rng.randrange(256)])
            else:
                content[at:at] = rng.choice(pieces)
        with contextlib.suppress(FloorPlanError):
            assert len(read_plan(bytes(content), format).lines) > 0
