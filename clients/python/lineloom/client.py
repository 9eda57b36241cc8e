"""The client."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, Self, TypeVar

import httpx

from lineloom import calls, config_calls, event_stream, export_calls
from lineloom.calls import Box, Call, Encoding, MapOptions
from lineloom.errors import ConnectionFailedError
from lineloom.retry import RetryPolicy
from lineloom.scan_like import ScanLike, batches
from lineloom.session import DEFAULT_BATCH, BatchTotal, Session, not_idle, not_ready
from lineloom.wire import (
    AnyEvent,
    Constraint,
    ConstraintDetail,
    ConstraintPage,
    Export,
    ExportList,
    FloorPlanAnswer,
    Graph,
    IngestAnswer,
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
    Scan,
    Site,
    SiteConfig,
    SiteList,
    Trajectory,
    Transform,
    WhatIf,
)

_FIRST_POLL = 0.05
_SLOWEST_POLL = 1.0
_T = TypeVar("_T")


class Client:
    """Lineloom over HTTP; may be shared by threads.

    url: default LINELOOM_URL, else the embedded service on this machine. token: default
    LINELOOM_TOKEN. encoding: of scans. compress: gzip bodies; None = unless the service runs on
    this machine. transport: for tests. Raises LineloomError and nothing else on purpose: see
    `lineloom.errors` for the tree.
    """

    def __init__(
        self,
        url: str | None = None,
        *,
        token: str | None = None,
        encoding: Encoding = "msgpack",
        compress: bool | None = None,
        retry: RetryPolicy | None = None,
        timeout: float = 30.0,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self.session = Session.build(url, token, encoding, compress, retry, timeout)
        self._http = httpx.Client(transport=transport, **self.session.http_options())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    # Ingest

    def post_scan(self, site: str, robot: str, scan: ScanLike) -> IngestAnswer:
        """Send one scan; when this returns, the service has it on disk."""
        return self.post_scans(site, robot, [scan])

    def post_scans(
        self, site: str, robot: str, scans: Iterable[ScanLike], *, batch: int = DEFAULT_BATCH
    ) -> IngestAnswer:
        """Send scans of one robot in order, in batches, and return the sum of the answers.

        Refused scans are listed in `rejected`, with their place in the whole list. Sending again
        is harmless: the service knows a scan by session and seq.
        """
        total = BatchTotal()
        for part in batches(scans, batch):
            total.add(self._post(site, robot, part), len(part))
        return total.answer

    def set_mount(self, site: str, robot: str, mount: MountSettings) -> Robot:
        """Say how the lidar sits on the robot; holds for the scans that follow."""
        return self._send(calls.put_mount(site, robot, mount))

    # Query

    def sites(self) -> SiteList:
        """Return all sites."""
        return self._send(calls.sites())

    def site(self, site: str) -> Site:
        """Return how a site is doing."""
        return self._send(calls.site(site))

    def robots(self, site: str) -> RobotList:
        """Return the robots of a site."""
        return self._send(calls.robots(site))

    def robot(self, site: str, robot: str) -> Robot:
        """Return one robot at its latest processed scan."""
        return self._send(calls.robot(site, robot))

    def trajectory(
        self, site: str, robot: str, *, align: bool = False, frame: MapFrame = "map"
    ) -> Trajectory:
        """Return the pose of every processed scan; align and frame as of `map_file`."""
        return self._send(calls.trajectory(site, robot, align, frame))

    def trajectory_text(
        self,
        site: str,
        robot: str,
        format: Literal["tum", "csv"] = "tum",
        *,
        align: bool = False,
        frame: MapFrame = "map",
    ) -> str:
        """Return the trajectory as text; align and frame as of `map_file`."""
        return self._send(calls.trajectory_text(site, robot, format, align, frame))

    def transform(self, site: str, robot_a: str, robot_b: str) -> Transform:
        """Return T_a_b; raises ConflictError while the two are not connected."""
        return self._send(calls.transform(site, robot_a, robot_b))

    def map(
        self,
        site: str,
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
        site: str,
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

    def export(self, site: str, format: MapFormat, options: MapOptions | None = None) -> Export:
        """Write the map as it is now into a file that stays, and return its address and hash."""
        return self._send(export_calls.post_export(site, format, options or MapOptions()))

    def exports(self, site: str) -> ExportList:
        """Return the exports of a site, oldest first."""
        return self._send(export_calls.exports(site))

    def export_file(self, site: str, export: str) -> bytes:
        """Return an export's bytes."""
        return self._send(export_calls.export_file(site, export))

    def delete_export(self, site: str, export: str) -> None:
        """Remove an export."""
        self._send(export_calls.delete_export(site, export))

    # Floor plan

    def config(self, site: str) -> SiteConfig:
        """Return every parameter that a site's map is made with."""
        return self._send(config_calls.config(site))

    def set_config(self, site: str, parameters: Mapping[str, Any]) -> SiteConfig:
        """Set a site's own parameters, nested by name, in place of those set before.

        `effect` of the answer says what follows: mostly that the map is made anew.
        """
        return self._send(config_calls.put_config(site, parameters))

    def config_difference(self, site: str) -> RemadeEvent:
        """Return what changed when the map was last made anew."""
        return self._send(config_calls.difference(site))

    def put_floorplan(self, site: str, content: bytes, media_type: str) -> FloorPlanAnswer:
        """Send the building's plan, and return where in it the map lies, or why that is open.

        media_type: application/geo+json, image/vnd.dxf, or text/plain for `x1, y1, x2, y2` lines.
        """
        return self._send(export_calls.put_floorplan(site, content, media_type))

    def floorplan(self, site: str) -> FloorPlanAnswer:
        """Return where in the plan each component lies."""
        return self._send(export_calls.floorplan(site))

    def delete_floorplan(self, site: str) -> None:
        """Forget the plan."""
        self._send(export_calls.delete_floorplan(site))

    def floorplan_differences(self, site: str, component: str | None = None) -> PlanDifferences:
        """Return walls of the plan that are missing, and walls that it does not have."""
        return self._send(export_calls.floorplan_differences(site, component))

    def floorplan_drawing(
        self, site: str, format: Literal["svg", "png"] = "svg", component: str | None = None
    ) -> bytes:
        """Return the differences as a picture."""
        return self._send(export_calls.floorplan_drawing(site, component, format))

    def graph(self, site: str, *, align: bool = False, frame: MapFrame = "map") -> Graph:
        """Return the pose graph; align and frame as of `map_file`."""
        return self._send(calls.graph(site, align, frame))

    def graph_g2o(self, site: str, *, align: bool = False, frame: MapFrame = "map") -> str:
        """Return the pose graph as g2o text; align and frame as of `map_file`."""
        return self._send(calls.graph_g2o(site, align, frame))

    def constraint_page(
        self,
        site: str,
        *,
        kind: str | None = None,
        state: str | None = None,
        limit: int | None = None,
        cursor: str | None = None,
    ) -> ConstraintPage:
        """Return one page of constraints."""
        return self._send(calls.constraints(site, kind, state, limit, cursor))

    def constraints(
        self, site: str, *, kind: str | None = None, state: str | None = None
    ) -> Iterator[Constraint]:
        """Yield every constraint, page by page."""
        cursor: str | None = None
        while True:
            page = self.constraint_page(site, kind=kind, state=state, cursor=cursor)
            yield from page.constraints
            cursor = page.next_cursor
            if cursor is None:
                return

    def constraint(self, site: str, constraint: str) -> ConstraintDetail:
        """Return a constraint with all of its evidence."""
        return self._send(calls.constraint(site, constraint))

    def constraint_svg(self, site: str, constraint: str) -> str:
        """Return a drawing of a constraint's evidence."""
        return self._send(calls.constraint_svg(site, constraint))

    def retract(self, site: str, constraint: str) -> Constraint:
        """Make the map as if a constraint had never been accepted; return what became of it."""
        return self._send(calls.act_on_constraint(site, constraint, "retract"))

    def restore(self, site: str, constraint: str) -> Constraint:
        """Take a retraction back; return what became of the constraint."""
        return self._send(calls.act_on_constraint(site, constraint, "restore"))

    def what_if(self, site: str, constraint: str) -> WhatIf:
        """Return what retracting a constraint, or restoring a retracted one, would do."""
        return self._send(calls.what_if(site, constraint))

    def match(self, reference: ScanLike, current: ScanLike) -> MatchAnswer:
        """Return where `current` was taken, seen from `reference`; adds nothing to any map."""
        return self._send(calls.match(reference, current))

    def localize(self, site: str, scans: Sequence[ScanLike]) -> LocalizeAnswer:
        """Return where the latest of a short run of one robot's scans was taken in a site's map.

        Adds nothing to the map.
        """
        return self._send(calls.localize(site, scans))

    def events(
        self, site: str, *, last_event_id: str | None = None, until_now: bool = False
    ) -> Iterator[AnyEvent]:
        """Yield what happens to a site from now on, or after the event `last_event_id`.

        Goes on by itself across lost connections and restarts of the service, missing nothing; a
        `reset` event says where that was not possible. Ends with what there is so far where
        `until_now`; else raises once the site is gone or the service stays away.
        """
        return event_stream.follow(self._http, self.session, site, last_event_id, until_now)

    # Wait

    def ready(self) -> Readiness:
        """Return whether scans are taken and mapped; never tried again."""
        return self._send(calls.ready())

    def wait_until_ready(self, timeout: float = 60.0, *, maps: bool = False) -> None:
        """Wait until scans are taken, and mapped at once where `maps`, or raise NotIdleError."""
        deadline = time.monotonic() + timeout
        while True:
            try:
                state = self.ready()
                reasons = state.reasons
                if state.maps if maps else state.takes_scans:
                    return
            except ConnectionFailedError as error:
                reasons = [error.reason]
            if time.monotonic() >= deadline:
                raise not_ready(self.session.url, timeout, reasons)
            time.sleep(4.0 * _FIRST_POLL)

    def wait_until_idle(
        self,
        site: str,
        timeout: float = 600.0,
        *,
        on_poll: Callable[[Site], object] | None = None,
    ) -> Site:
        """Wait until all that was accepted is in the map, loops and merges included.

        Returns the site at that moment; raises NotIdleError after `timeout` seconds. on_poll is
        given every answer on the way.
        """
        deadline = time.monotonic() + timeout
        pause = _FIRST_POLL
        while True:
            state = self.site(site)
            if on_poll is not None:
                on_poll(state)
            if state.idle:
                return state
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise not_idle(state, timeout)
            time.sleep(min(pause, left))
            pause = min(1.5 * pause, _SLOWEST_POLL)

    def _post(self, site: str, robot: str, part: Sequence[Scan]) -> IngestAnswer:
        call = calls.post_scans(
            site,
            robot,
            part,
            encoding=self.session.encoding,
            compress=self.session.compress,
        )
        return self._send(call)

    def _send(self, call: Call[_T]) -> _T:
        for attempt in itertools.count():
            try:
                response = self._http.request(**self.session.request_options(call))
            except httpx.TransportError as error:
                time.sleep(self.session.after_failure(call, attempt, error))
                continue
            pause = self.session.after_answer(call, attempt, response)
            if pause is None:
                return call.read(response)
            time.sleep(pause)
        raise AssertionError("unreachable: attempts are counted without end")
