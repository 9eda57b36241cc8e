"""The floor plans of the sites, and where in them their maps lie."""

from __future__ import annotations

import asyncio
import hashlib
import json
import time
from collections.abc import Awaitable, Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from lineloom_core.floorplan.fit import Judge
from lineloom_core.floorplan.plan import FloorPlan
from lineloom_core.floorplan.registration import Registration, follow, judge_of, register
from lineloom_core.fusion.occupancy import Rays, rasterise
from lineloom_core.mapping.answers.site_view import MapLine, SiteView
from numpy.typing import NDArray

from lineloom_service.store.actions import remove_file
from lineloom_service.store.files import FileRecord, list_files, put_file, read_file
from lineloom_service.store.protocol import Store
from lineloom_service.store.records import SiteRecord

RaySource = Callable[[str], Awaitable[Rays]]
"""Tells what the lidars of a component's keyframes saw as free, in its map frame."""

_NAME = "plan"
_CELL_M = 0.1


@dataclass(frozen=True, eq=False)
class StoredPlan:
    """sha256: of the plan's lines, as they are kept."""

    sha256: str
    plan: FloorPlan


@dataclass(frozen=True, eq=False)
class _Known:
    """A placement, and of what: the plan, and how much there was of the map."""

    sha256: str
    extent: tuple[int, int, bool]
    registration: Registration


class FloorPlans:
    """Keeps plans in the store, and placements in memory: they follow from plan and map."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._plans: dict[int, StoredPlan] = {}
        self._known: dict[tuple[int, str], _Known] = {}
        self._busy = asyncio.Lock()
        """One search at a time: it takes seconds of a core."""

    async def put(self, site: SiteRecord, plan: FloorPlan) -> StoredPlan:
        """Keep a plan in the place of the one before."""
        data = np.ascontiguousarray(plan.lines, dtype="<f8").tobytes()
        stored = StoredPlan(hashlib.sha256(data).hexdigest(), plan)
        about = json.dumps({"lines": len(plan.lines)})
        file = FileRecord(_NAME, about, stored.sha256, len(data), time.time(), data)
        await self._store.write(put_file, site.id, "floorplan", file)
        return stored

    async def plan(self, site: SiteRecord) -> StoredPlan | None:
        """Return the plan of a site."""
        files = await self._store.read(list_files, site.id, "floorplan")
        if not files:
            return None
        known = self._plans.get(site.id)
        if known is None or known.sha256 != files[0].sha256:
            file = await self._store.read(read_file, site.id, "floorplan", _NAME)
            if file is None or file.data is None:
                return None
            lines = np.frombuffer(file.data, dtype="<f8").reshape(-1, 4)
            known = self._plans[site.id] = StoredPlan(file.sha256, FloorPlan.of(lines))
        return known

    async def remove(self, site: SiteRecord) -> bool:
        """Forget the plan; False where there is none."""
        self._plans.pop(site.id, None)
        return await self._store.write(remove_file, site.id, "floorplan", _NAME)

    async def placements(
        self,
        rays: RaySource,
        site: SiteRecord,
        view: SiteView,
        plan: StoredPlan,
        components: Sequence[str],
    ) -> dict[str, Registration]:
        """Return where components lie. What was found before follows the map as it grows."""
        async with self._busy:
            return {
                component: await self._placement(rays, site, view, plan, component)
                for component in components
            }

    async def _placement(
        self, rays: RaySource, site: SiteRecord, view: SiteView, plan: StoredPlan, component: str
    ) -> Registration:
        extent = _extent(view, component)
        known = self._known.get((site.id, component))
        if known is not None and (known.sha256, known.extent) == (plan.sha256, extent):
            return known.registration
        former = known.registration if known and known.sha256 == plan.sha256 else None
        seen, lines = await rays(component), lines_of(view, component)
        found = await asyncio.to_thread(_place, plan.plan, seen, lines, former)
        self._known[site.id, component] = _Known(plan.sha256, extent, found)
        return found


async def judge_component(
    plan: FloorPlan, rays: RaySource, view: SiteView, component: str
) -> Judge:
    """Return the comparison of a component with a plan."""
    seen, lines = await rays(component), lines_of(view, component)
    return await asyncio.to_thread(_judge, plan, seen, lines)


def solid_lines(view: SiteView, component: str) -> list[MapLine]:
    """Return the lines of a component that a building is known by: all but clutter."""
    return [w for w in view.lines if w.component == component and w.layer != "clutter"]


def lines_of(view: SiteView, component: str) -> NDArray[np.float64]:
    """Return those lines as rows x1, y1, x2, y2 [m]."""
    return rows_of(solid_lines(view, component))


def rows_of(lines: Iterable[MapLine]) -> NDArray[np.float64]:
    """Return lines as rows x1, y1, x2, y2 [m]."""
    rows = [(w.x1, w.y1, w.x2, w.y2) for w in lines]
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def _extent(view: SiteView, component: str) -> tuple[int, int, bool]:
    """Return how many keyframes there are, constraints in all, and whether it is settled.

    That is what moves the map.
    """
    keyframes = sum(1 for k in view.keyframes if k.component == component)
    accepted = sum(1 for c in view.constraints if c.state == "accepted")
    return keyframes, accepted, view.settled


def _judge(plan: FloorPlan, rays: Rays, lines: NDArray[np.float64]) -> Judge:
    return judge_of(plan, lines, rasterise(rays, lines, _CELL_M))


def _place(
    plan: FloorPlan, rays: Rays, lines: NDArray[np.float64], former: Registration | None
) -> Registration:
    grid = rasterise(rays, lines, _CELL_M)
    followed = None if former is None else follow(judge_of(plan, lines, grid), former)
    return followed or register(plan, lines, grid)
