"""The calls of the client that are one question and its answer."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, TypeVar

from lineloom import calls, config_calls, export_calls
from lineloom.calls import Box, Call, MapOptions, Name
from lineloom.scan_like import ScanLike
from lineloom.wire import (
    Constraint,
    ConstraintDetail,
    ConstraintPage,
    Export,
    ExportList,
    FloorPlanAnswer,
    Graph,
    JoinRequest,
    JoinTrial,
    LocalizeAnswer,
    MapAnswer,
    MapFormat,
    MapFrame,
    MatchAnswer,
    MountSettings,
    PlanDifferences,
    Readiness,
    RemadeEvent,
    Robot,
    RobotList,
    Site,
    SiteConfig,
    SiteList,
    Trajectory,
    Transform,
    WhatIf,
)

_T = TypeVar("_T")


class Queries(ABC):
    """What can be asked and set; how a call is sent is the client's matter."""

    @abstractmethod
    def _send(self, call: Call[_T]) -> _T:
        """Send a call, again where that may help, and read its answer."""

    def set_mount(self, site: Name, robot: Name, mount: MountSettings) -> Robot:
        """Say how the lidar sits on the robot; holds for the scans that follow."""
        return self._send(calls.put_mount(site, robot, mount))

    def sites(self) -> SiteList:
        """Return all sites."""
        return self._send(calls.sites())

    def site(self, site: Name) -> Site:
        """Return how a site is doing."""
        return self._send(calls.site(site))

    def robots(self, site: Name) -> RobotList:
        """Return the robots of a site."""
        return self._send(calls.robots(site))

    def robot(self, site: Name, robot: Name) -> Robot:
        """Return one robot at its latest processed scan."""
        return self._send(calls.robot(site, robot))

    def delete_robot(self, site: Name, robot: Name) -> None:
        """Forget a robot: its scans, and what of the map rests on them alone."""
        self._send(calls.delete_robot(site, robot))

    def delete_site(self, site: Name) -> None:
        """Forget a site: scans, map, exports and floor plan."""
        self._send(calls.delete_site(site))

    def trajectory(
        self, site: Name, robot: Name, *, align: bool = False, frame: MapFrame = "map"
    ) -> Trajectory:
        """Return the pose of every processed scan; align and frame as of `map_file`."""
        return self._send(calls.trajectory(site, robot, align, frame))

    def trajectory_text(
        self,
        site: Name,
        robot: Name,
        format: Literal["tum", "csv"] = "tum",
        *,
        align: bool = False,
        frame: MapFrame = "map",
    ) -> str:
        """Return the trajectory as text; align and frame as of `map_file`."""
        return self._send(calls.trajectory_text(site, robot, format, align, frame))

    def transform(self, site: Name, robot_a: Name, robot_b: Name) -> Transform:
        """Return T_a_b; raises ConflictError while the two are not connected."""
        return self._send(calls.transform(site, robot_a, robot_b))

    def map(
        self,
        site: Name,
        *,
        component: str | None = None,
        bbox: Box | None = None,
        since: int | None = None,
    ) -> MapAnswer:
        """Return the fused line map; bbox = (min x, min y, max x, max y) in the map frame.

        since: a version; the answer has only what changed after it, unless `full`.
        """
        return self._send(calls.map_lines(site, component, bbox, since))

    def map_file(
        self,
        site: Name,
        format: MapFormat,
        *,
        component: str | None = None,
        bbox: Box | None = None,
        align: bool = False,
        frame: MapFrame = "map",
        resolution: float | None = None,
    ) -> bytes:
        """Return the map as a file of the format named.

        align: turned so that walls run along the axes. frame: "plan" for the floor plan's
        coordinates. resolution [m]: of nav2's cells.
        """
        options = MapOptions(component, bbox, align, frame, resolution)
        return self._send(calls.map_file(site, format, options))

    def export(self, site: Name, format: MapFormat, options: MapOptions | None = None) -> Export:
        """Write the map as it is now into a file that stays, and return its address and hash."""
        return self._send(export_calls.post_export(site, format, options or MapOptions()))

    def exports(self, site: Name) -> ExportList:
        """Return the exports of a site, oldest first."""
        return self._send(export_calls.exports(site))

    def export_file(self, site: Name, export: str) -> bytes:
        """Return an export's bytes."""
        return self._send(export_calls.export_file(site, export))

    def delete_export(self, site: Name, export: str) -> None:
        """Remove an export."""
        self._send(export_calls.delete_export(site, export))

    # Floor plan

    def config(self, site: Name) -> SiteConfig:
        """Return every parameter that a site's map is made with."""
        return self._send(config_calls.config(site))

    def set_config(self, site: Name, parameters: Mapping[str, Any]) -> SiteConfig:
        """Set a site's own parameters, nested by name, in place of those set before.

        `effect` of the answer says what follows: mostly that the map is made anew.
        """
        return self._send(config_calls.put_config(site, parameters))

    def config_difference(self, site: Name) -> RemadeEvent:
        """Return what changed when the map was last made anew."""
        return self._send(config_calls.difference(site))

    def put_floorplan(self, site: Name, content: bytes, media_type: str) -> FloorPlanAnswer:
        """Send the building's plan, and return where in it the map lies, or why that is open.

        media_type: application/geo+json, image/vnd.dxf, or text/plain for `x1, y1, x2, y2` lines.
        """
        return self._send(export_calls.put_floorplan(site, content, media_type))

    def floorplan(self, site: Name) -> FloorPlanAnswer:
        """Return where in the plan each component lies."""
        return self._send(export_calls.floorplan(site))

    def delete_floorplan(self, site: Name) -> None:
        """Forget the plan."""
        self._send(export_calls.delete_floorplan(site))

    def floorplan_differences(self, site: Name, component: str | None = None) -> PlanDifferences:
        """Return walls of the plan that are missing, and walls that it does not have."""
        return self._send(export_calls.floorplan_differences(site, component))

    def floorplan_drawing(
        self, site: Name, format: Literal["svg", "png"] = "svg", component: str | None = None
    ) -> bytes:
        """Return the differences as a picture."""
        return self._send(export_calls.floorplan_drawing(site, component, format))

    def graph(self, site: Name, *, align: bool = False, frame: MapFrame = "map") -> Graph:
        """Return the pose graph; align and frame as of `map_file`."""
        return self._send(calls.graph(site, align, frame))

    def graph_g2o(self, site: Name, *, align: bool = False, frame: MapFrame = "map") -> str:
        """Return the pose graph as g2o text; align and frame as of `map_file`."""
        return self._send(calls.graph_g2o(site, align, frame))

    def constraint_page(
        self,
        site: Name,
        *,
        kind: str | None = None,
        state: str | None = None,
        limit: int | None = None,
        cursor: str | None = None,
    ) -> ConstraintPage:
        """Return one page of constraints."""
        return self._send(calls.constraints(site, kind, state, limit, cursor))

    def constraints(
        self, site: Name, *, kind: str | None = None, state: str | None = None
    ) -> Iterator[Constraint]:
        """Yield every constraint, page by page."""
        cursor: str | None = None
        while True:
            page = self.constraint_page(site, kind=kind, state=state, cursor=cursor)
            yield from page.constraints
            cursor = page.next_cursor
            if cursor is None:
                return

    def constraint(self, site: Name, constraint: str) -> ConstraintDetail:
        """Return a constraint with all of its evidence."""
        return self._send(calls.constraint(site, constraint))

    def constraint_svg(self, site: Name, constraint: str) -> str:
        """Return a drawing of a constraint's evidence."""
        return self._send(calls.constraint_svg(site, constraint))

    def retract(self, site: Name, constraint: str) -> Constraint:
        """Make the map as if a constraint had never been accepted; return what became of it."""
        return self._send(calls.act_on_constraint(site, constraint, "retract"))

    def restore(self, site: Name, constraint: str) -> Constraint:
        """Take a retraction back; return what became of the constraint."""
        return self._send(calls.act_on_constraint(site, constraint, "restore"))

    def what_if(self, site: Name, constraint: str) -> WhatIf:
        """Return what retracting a constraint, or restoring a retracted one, would do."""
        return self._send(calls.what_if(site, constraint))

    def confirm(self, site: Name, constraint: str) -> Constraint:
        """Believe a candidate, or one that was rejected; return what became of it."""
        return self._send(calls.act_on_constraint(site, constraint, "confirm"))

    def join(self, site: Name, request: JoinRequest) -> Constraint:
        """Say that two scans or places are at the same place; return the constraint made of it."""
        return self._send(calls.join(site, request))

    def try_join(self, site: Name, request: JoinRequest) -> JoinTrial:
        """Return what `join` would come to, and what speaks against it; changes nothing."""
        return self._send(calls.try_join(site, request))

    def match(self, reference: ScanLike, current: ScanLike) -> MatchAnswer:
        """Return where `current` was taken, seen from `reference`; adds nothing to any map."""
        return self._send(calls.match(reference, current))

    def localize(self, site: Name, scans: ScanLike | Sequence[ScanLike]) -> LocalizeAnswer:
        """Return where a scan was taken in a site's map; of a short run of one robot, the latest.

        Adds nothing to the map.
        """
        return self._send(calls.localize(site, scans))

    def ready(self) -> Readiness:
        """Return whether scans are taken and mapped; never tried again."""
        return self._send(calls.ready())
