"""In which frame a map is shown: the robots' own, straightened, or the floor plan's."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import Query
from lineloom.wire.export import MapFrame
from lineloom_core.floorplan.alignment import aligning
from lineloom_core.geometry import Pose
from lineloom_core.io.reframe import in_frames, only
from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service import __version__
from lineloom_service.errors import (
    INVALID_PARAMETER,
    NO_FLOOR_PLAN,
    NOT_REGISTERED,
    ProblemError,
)
from lineloom_service.floorplans import lines_of
from lineloom_service.map_files import FramedView, ray_source
from lineloom_service.service import Service
from lineloom_service.store.records import SiteRecord

AlignQuery = Annotated[
    bool, Query(description="Turned so that walls run along the axes; not with frame=plan.")
]
FrameQuery = Annotated[
    MapFrame, Query(description="In the map's own coordinates, or the floor plan's.")
]


async def versioned(
    service: Service, site: SiteRecord, view: SiteView, frame: MapFrame = "map"
) -> dict[str, str]:
    """Return the headers of an answer made of nothing but a view.

    The ETag names what it is a function of; in the plan's frame, the plan is part of that.
    """
    etag = f"{site.id}-{view.version}{'-settled' if view.settled else ''}-{__version__}"
    if frame == "plan":
        plan = await service.floorplans.plan(site)
        etag += "-none" if plan is None else f"-{plan.sha256[:16]}"
    return {"ETag": f'"{etag}"', "Cache-Control": "no-cache"}


async def in_frame(
    service: Service,
    site: SiteRecord,
    view: SiteView,
    *,
    align: bool,
    frame: str,
    component: str | None = None,
) -> FramedView:
    """Return the view in the frame asked for. Raises ProblemError where there is none such.

    In the plan's frame only those components are shown that have a place there, and the plan says
    how they are turned: `align` has nothing to add.
    """
    if frame == "map":
        return await asyncio.to_thread(_aligned, view) if align else FramedView(view)
    if frame != "plan":
        raise ProblemError(INVALID_PARAMETER, f"frame: must be map or plan, not {frame!r}")
    return await _in_plan(service, site, view, component)


def _aligned(view: SiteView) -> FramedView:
    frames = {c.id: aligning(lines_of(view, c.id)) for c in view.components}
    return FramedView(in_frames(view, frames), frames)


async def _in_plan(
    service: Service, site: SiteRecord, view: SiteView, component: str | None
) -> FramedView:
    plan = await service.floorplans.plan(site)
    if plan is None:
        raise ProblemError(NO_FLOOR_PLAN, f"site {site.name!r} has no floor plan; PUT one")
    wanted = [c.id for c in view.components if component in (None, c.id)]
    placed = await service.floorplans.placements(
        ray_source(service, site, view), site, view, plan, wanted
    )
    frames: dict[str, Pose] = {
        name: p.T_plan_map for name, p in placed.items() if p.T_plan_map is not None
    }
    if not frames:
        why = "; ".join(f"{name}: {p.reason}" for name, p in placed.items()) or "nothing is mapped"
        raise ProblemError(NOT_REGISTERED, why)
    return FramedView(in_frames(only(view, frames), frames), frames)
