"""The map as a file: `wire.MAP_FORMATS` has the formats, `lineloom_core.io` a writer for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module

from lineloom import wire
from lineloom_core.fusion.occupancy import (
    DEFAULT_RESOLUTION_M,
    GridTooLargeError,
    Rays,
    rasterise,
)
from lineloom_core.geometry import Pose
from lineloom_core.io import nav2
from lineloom_core.io.png import PictureTooLargeError
from lineloom_core.io.reframe import in_layers
from lineloom_core.io.selection import MOST_COORDINATE_M, BBox, check_bbox
from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.asking import ask
from lineloom_service.errors import INVALID_PARAMETER, ProblemError
from lineloom_service.floorplans import RaySource, rows_of
from lineloom_service.maps.line_history import LineHistory
from lineloom_service.maps.map_json import write_line, write_map
from lineloom_service.service import Service
from lineloom_service.store.records import SiteRecord

_WRITERS = "lineloom_core.io"


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
    layers: tuple[str, ...] = wire.USUAL_LAYERS,
) -> bytes:
    """Return the map as a file. Raises ProblemError for what cannot be drawn."""
    shown = replace(shown, view=in_layers(shown.view, layers))
    if format == "nav2":
        return await _nav2(service, site, shown, component, box, resolution, layers)
    if resolution is not None:
        raise ProblemError(INVALID_PARAMETER, "resolution: only a nav2 map has one")
    form = (format, component, box, shown.key, layers)
    write = _json if format == "json" else import_module(f"{_WRITERS}.{format}").write_map
    try:
        return await service.maps.other(
            site,
            shown.view,
            form,
            lambda: write(shown.view, component, box, site.name),
            is_large=True,
        )
    except PictureTooLargeError as error:
        raise ProblemError(INVALID_PARAMETER, f"format: {error}") from None


def ray_source(service: Service, site: SiteRecord, view: SiteView) -> RaySource:
    """Return who to ask for the rays of a site's components: settled ones where the view is."""

    async def rays(component: str) -> Rays:
        found: Rays = await ask(service, site, "rays", component, view.settled)
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
        detail = (
            "query parameter 'bbox': must be x_min,y_min,x_max,y_max with min < max, "
            f"within {MOST_COORDINATE_M / 1000:g} km of the origin"
        )
        raise ProblemError(INVALID_PARAMETER, detail) from None
    return box


def read_layers(text: str | None) -> tuple[str, ...]:
    """Return the layers that `wall,furniture` and the like means. Raises ProblemError."""
    if text is None:
        return wire.USUAL_LAYERS
    wanted = {part.strip() for part in text.split(",")}
    if not wanted <= set(wire.LAYERS):
        detail = f"query parameter 'layers': must be of {', '.join(wire.LAYERS)}, with commas"
        raise ProblemError(INVALID_PARAMETER, detail)
    return tuple(layer for layer in wire.LAYERS if layer in wanted)


def _json(view: SiteView, component: str | None, box: BBox | None, site: str) -> bytes:
    return write_map(
        site, view, LineHistory(write_line).at(view), component, box, layers=wire.LAYERS
    )


async def _nav2(
    service: Service,
    site: SiteRecord,
    shown: FramedView,
    component: str | None,
    box: BBox | None,
    resolution: float | None,
    layers: tuple[str, ...],
) -> bytes:
    components = [c.id for c in shown.view.components]
    chosen = component or (components[0] if len(components) == 1 else None)
    if chosen is None:
        there = ", ".join(components) or "none yet"
        detail = f"component: a nav2 map is of one component, name it; there is: {there}"
        raise ProblemError(INVALID_PARAMETER, detail)
    T = shown.frames.get(chosen, Pose.identity())
    rays = (await ray_source(service, site, shown.view)(chosen)).moved(T)
    lines = rows_of(w for w in shown.view.lines if w.component == chosen)
    cell = resolution or DEFAULT_RESOLUTION_M
    # Free space may be some scans newer than the view: the keyframes tell one from the next.
    form = ("nav2", chosen, box, shown.key, cell, layers, rays.poses.tobytes())
    try:
        return await service.maps.other(
            site,
            shown.view,
            form,
            lambda: nav2.write_map(rasterise(rays, lines, cell, box)),
            is_large=True,
        )
    except GridTooLargeError as error:
        raise ProblemError(INVALID_PARAMETER, f"resolution: {error}") from None
