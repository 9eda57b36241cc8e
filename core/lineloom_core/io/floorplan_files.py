"""Floor plans from files: GeoJSON, DXF, or text with `x1, y1, x2, y2` on each line."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Iterable, Iterator
from typing import Any, Literal

from lineloom_core.floorplan.plan import MOST_LINES, FloorPlan, FloorPlanError

PlanFormat = Literal["geojson", "dxf", "text"]

Segment = tuple[float, float, float, float]

_CURVE_STEP_M = 0.05
"""How far a chord may lie from the curve that it stands for."""


def read_plan(content: bytes, format: PlanFormat) -> FloorPlan:
    """Return the plan in metres. Raises FloorPlanError saying what is wrong, and where."""
    try:
        # Names in drawings of old have an encoding of their own; lines need none.
        text = content.decode("utf-8-sig", "replace" if format == "dxf" else "strict")
    except UnicodeDecodeError:
        raise FloorPlanError("is not UTF-8 text") from None
    readers = {"geojson": _geojson, "dxf": _dxf, "text": _text}
    segments = []
    for segment in readers[format](text):
        segments.append(segment)
        if len(segments) > MOST_LINES:
            raise FloorPlanError(f"holds more than {MOST_LINES} lines")
    return FloorPlan.of(segments)


def _text(text: str) -> Iterator[Segment]:
    for number, row in enumerate(text.splitlines(), start=1):
        content = row.split("#", 1)[0].strip()
        if not content:
            continue
        try:
            x1, y1, x2, y2 = (float(f) for f in content.replace(",", " ").split())
        except ValueError:
            raise FloorPlanError(
                f"line {number}: expected four numbers 'x1, y1, x2, y2': {row.strip()[:60]!r}"
            ) from None
        yield _finite((x1, y1, x2, y2), f"line {number}")


def _geojson(text: str) -> Iterator[Segment]:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FloorPlanError(f"is not JSON that can be read: {error}") from None
    if not isinstance(document, dict):
        raise FloorPlanError("is no GeoJSON object")
    if document.get("type") == "FeatureCollection":
        features = document.get("features")
        if not isinstance(features, list):
            raise FloorPlanError("features: must be a list")
        for i, feature in enumerate(features):
            geometry = feature.get("geometry") if isinstance(feature, dict) else None
            yield from _geometry(geometry, f"features/{i}/geometry")
    elif document.get("type") == "Feature":
        yield from _geometry(document.get("geometry"), "geometry")
    else:
        yield from _geometry(document, "geometry")


def _geometry(geometry: Any, where: str) -> Iterator[Segment]:
    """Yield what is drawn of lines and outlines; points mark no wall."""
    if geometry is None:
        return
    if not isinstance(geometry, dict):
        raise FloorPlanError(f"{where}: must be an object")
    kind, coordinates = str(geometry.get("type")), geometry.get("coordinates")
    depth = {"LineString": 1, "MultiLineString": 2, "Polygon": 2, "MultiPolygon": 3}
    if kind == "GeometryCollection":
        parts = geometry.get("geometries")
        if not isinstance(parts, list):
            raise FloorPlanError(f"{where}/geometries: must be a list")
        for i, part in enumerate(parts):
            # One in another would be GeoJSON, but nobody's plan; and has no end.
            if isinstance(part, dict) and part.get("type") == kind:
                raise FloorPlanError(f"{where}/geometries/{i}: a collection within a collection")
            yield from _geometry(part, f"{where}/geometries/{i}")
    elif kind in depth:
        yield from _rings(coordinates, depth[kind], f"{where}/coordinates")
    elif kind not in ("Point", "MultiPoint"):
        raise FloorPlanError(f"{where}: {kind!r} is no type of geometry")


def _rings(coordinates: Any, depth: int, where: str) -> Iterator[Segment]:
    if not isinstance(coordinates, list):
        raise FloorPlanError(f"{where}: must be a list")
    if depth > 1:
        for i, part in enumerate(coordinates):
            yield from _rings(part, depth - 1, f"{where}/{i}")
        return
    try:
        points = [(_number(p[0]), _number(p[1])) for p in coordinates]
    except (TypeError, IndexError, KeyError, OverflowError):
        raise FloorPlanError(f"{where}: positions must be pairs of numbers") from None
    yield from _chain(points, where)


def _number(value: object) -> float:
    """Return a number of JSON; a bool is none, nor is a string."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError
    return float(value)


def _dxf(text: str) -> Iterator[Segment]:
    """Yield lines, polylines and curves of the model space, blocks taken apart, in metres."""
    try:
        yield from _dxf_segments(text)
    except FloorPlanError:
        raise
    except Exception as error:
        # ezdxf meets a broken file with whatever its parts happen to raise.
        reason = str(error).strip().splitlines()[:1] or [type(error).__name__]
        raise FloorPlanError(f"is no DXF that can be read: {reason[0][:200]}") from None


def _dxf_segments(text: str) -> Iterator[Segment]:
    # Here, so that a service that starts need not wait for it.
    from ezdxf import units
    from ezdxf.disassemble import recursive_decompose, to_primitives
    from ezdxf.enums import InsertUnits
    from ezdxf.filemanagement import read as read_dxf

    document = read_dxf(io.StringIO(text))
    scale = 1.0
    if document.units != InsertUnits.Unitless:
        units_in = InsertUnits(document.units)
        scale = float(units.conversion_factor(units_in, InsertUnits.Meters))
    kinds = {"LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE"}
    entities = (e for e in recursive_decompose(document.modelspace()) if e.dxftype() in kinds)
    for primitive in to_primitives(entities, max_flattening_distance=_CURVE_STEP_M / scale):
        points = [(v.x * scale, v.y * scale) for v in primitive.vertices()]
        yield from _chain(points, f"entity {primitive.entity}")


def _chain(points: Iterable[tuple[float, float]], where: str) -> Iterator[Segment]:
    before: tuple[float, float] | None = None
    for point in points:
        if before is not None:
            yield _finite((*before, *point), where)
        before = point


def _finite(segment: Segment, where: str) -> Segment:
    if not all(math.isfinite(v) for v in segment):
        raise FloorPlanError(f"{where}: coordinates must be finite numbers")
    return segment
