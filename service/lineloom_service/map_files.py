"""The map as a file: which formats there are, and what each is made of."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from lineloom_core.fusion.occupancy import (
    DEFAULT_RESOLUTION_M,
    GridTooLargeError,
    Rays,
    rasterise,
)
from lineloom_core.geometry import Pose
from lineloom_core.io import csv, dxf, geojson, ieee1873, nav2, png, svg
from lineloom_core.io.selection import BBox, check_bbox
from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.answers import JSON
from lineloom_service.asking import ask
from lineloom_service.errors import INVALID_PARAMETER, ProblemError
from lineloom_service.floorplans import RaySource, lines_of
from lineloom_service.maps.line_history import LineHistory
from lineloom_service.maps.map_json import write_line, write_map
from lineloom_service.service import Service
from lineloom_service.store.records import SiteRecord


@dataclass(frozen=True, slots=True)
class MapFormat:
    """media_type: of the answer. suffix: of a file's name."""

    media_type: str
    suffix: str


FORMATS: Mapping[str, MapFormat] = {
    "json": MapFormat(JSON, "json"),
    "geojson": MapFormat("application/geo+json", "geojson"),
    "svg": MapFormat("image/svg+xml", "svg"),
    "png": MapFormat("image/png", "png"),
    "dxf": MapFormat("image/vnd.dxf", "dxf"),
    "csv": MapFormat("text/csv", "csv"),
    "ieee1873": MapFormat("application/xml", "xml"),
    "nav2": MapFormat("application/zip", "zip"),
}
"""What a map can be had as; `core/docs/formats.md` tells of each."""

_Render = Callable[[str, SiteView, str | None, BBox | None], str | bytes]

_RENDER: Mapping[str, _Render] = {
    "json": lambda site, view, c, box: write_map(
        site, view, LineHistory(write_line).at(view), c, box
    ),
    "geojson": lambda _, view, c, box: json.dumps(
        geojson.map_features(view, c, box), separators=(",", ":")
    ),
    "svg": lambda _, view, c, box: svg.render_map(view, c, box),
    "png": lambda _, view, c, box: png.render_map(view, c, box),
    "dxf": lambda _, view, c, box: dxf.write_map(view, c, box),
    "csv": lambda _, view, c, box: csv.write_map(view, c, box),
    "ieee1873": lambda site, view, c, box: ieee1873.write_map(view, c, box, site),
}


@dataclass(frozen=True)
class FramedView:
    """A view, and by component the frame that it was moved to: T_shown_map."""

    view: SiteView
    frames: Mapping[str, Pose] = field(default_factory=dict)

    @property
    def key(self) -> tuple[tuple[str, Pose], ...]:
        """What tells it from the same view in other frames."""
        return tuple(sorted(self.frames.items(), key=lambda item: item[0]))


async def render_map(
    service: Service,
    site: SiteRecord,
    shown: FramedView,
    format: str,
    component: str | None,
    box: BBox | None,
    resolution: float | None = None,
) -> bytes:
    """Return the map as a file. Raises ProblemError for what cannot be drawn."""
    if format == "nav2":
        return await _nav2(service, site, shown, component, box, resolution)
    if resolution is not None:
        raise ProblemError(INVALID_PARAMETER, "resolution: only a nav2 map has one")
    form = (format, component, box, shown.key)
    return await service.maps.other(
        site, shown.view, form, lambda: _RENDER[format](site.name, shown.view, component, box)
    )


def ray_source(service: Service, site: SiteRecord) -> RaySource:
    """Return who to ask for the rays of a site's components."""

    async def rays(component: str) -> Rays:
        found: Rays = await ask(service, site, "rays", component)
        return found

    return rays


def read_bbox(text: str | None) -> BBox | None:
    """Return the box that `x_min,y_min,x_max,y_max` means. Raises ProblemError."""
    if text is None:
        return None
    try:
        x_min, y_min, x_max, y_max = (float(part) for part in text.split(","))
        box = (x_min, y_min, x_max, y_max)
        check_bbox(box)
    except ValueError:
        detail = "query parameter 'bbox': must be x_min,y_min,x_max,y_max with min < max"
        raise ProblemError(INVALID_PARAMETER, detail) from None
    return box


async def _nav2(
    service: Service,
    site: SiteRecord,
    shown: FramedView,
    component: str | None,
    box: BBox | None,
    resolution: float | None,
) -> bytes:
    components = [c.id for c in shown.view.components]
    chosen = component or (components[0] if len(components) == 1 else None)
    if chosen is None:
        there = ", ".join(components) or "none yet"
        detail = f"component: a nav2 map is of one component, name it; there is: {there}"
        raise ProblemError(INVALID_PARAMETER, detail)
    T = shown.frames.get(chosen, Pose.identity())
    rays = (await ray_source(service, site)(chosen)).moved(T)
    lines = lines_of(shown.view, chosen)
    try:
        grid = await asyncio.to_thread(
            rasterise, rays, lines, resolution or DEFAULT_RESOLUTION_M, box
        )
    except GridTooLargeError as error:
        raise ProblemError(INVALID_PARAMETER, f"resolution: {error}") from None
    return await asyncio.to_thread(nav2.write_map, grid)
