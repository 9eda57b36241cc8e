"""The calls of the contract without any I/O: what to send, and how to read the answer.

`Client` and `AsyncClient` differ only in how they wait; everything else is here.
"""

from __future__ import annotations

import gzip
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Generic, Literal, TypeVar
from urllib.parse import quote

import httpx
from pydantic import BaseModel, ValidationError

from lineloom.errors import UnexpectedAnswerError, problem_error
from lineloom.retry import parse_retry_after
from lineloom.scan_like import ScanLike, to_match_scan
from lineloom.wire import (
    JSON,
    MSGPACK,
    Constraint,
    ConstraintDetail,
    ConstraintPage,
    Graph,
    IngestAnswer,
    JoinRequest,
    JoinTrial,
    LocalizeAnswer,
    LocalizeRequest,
    MapAnswer,
    MapFormat,
    MapFrame,
    MatchAnswer,
    MatchRequest,
    MountSettings,
    Problem,
    Readiness,
    Robot,
    RobotList,
    RobotSettings,
    Scan,
    Site,
    SiteList,
    Trajectory,
    Transform,
    WhatIf,
    pack_json,
    pack_msgpack,
)

Encoding = Literal["json", "msgpack"]
Box = tuple[float, float, float, float]
Name = str | int
"""Of a site or a robot; a number is its digits."""

_COMPRESS_FROM_BYTES = 1024
_T = TypeVar("_T")
_ModelT = TypeVar("_ModelT", bound=BaseModel)


@dataclass(frozen=True)
class MapOptions:
    """What of a map, and how it lies: as in `wire.ExportRequest`."""

    component: str | None = None
    bbox: Box | None = None
    align: bool = False
    frame: MapFrame = "map"
    resolution: float | None = None


@dataclass(frozen=True)
class Call(Generic[_T]):
    """One request, and how to read its answer. retried: whether 5xx, 408, 429 are tried again."""

    method: str
    path: str
    read: Callable[[httpx.Response], _T]
    params: Mapping[str, str] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    content: bytes | None = None
    retried: bool = True


def post_scans(
    site: Name, robot: Name, scans: Sequence[Scan], *, encoding: Encoding, compress: bool
) -> Call[IngestAnswer]:
    """POST one batch."""
    body = pack_json(scans) if encoding == "json" else pack_msgpack(scans)
    headers = {"Content-Type": JSON if encoding == "json" else MSGPACK}
    if compress and len(body) >= _COMPRESS_FROM_BYTES:
        # Level 1: a robot's processor is worth more than the last few per cent.
        body = gzip.compress(body, compresslevel=1, mtime=0)
        headers["Content-Encoding"] = "gzip"
    path = f"{_robot(site, robot)}/scans"
    return Call("POST", path, read_model(IngestAnswer), headers=headers, content=body)


def put_mount(site: Name, robot: Name, mount: MountSettings) -> Call[Robot]:
    """PUT the laser's pose on the robot."""
    body = RobotSettings(mount=mount).model_dump_json().encode()
    return Call(
        "PUT",
        _robot(site, robot),
        read_model(Robot),
        headers={"Content-Type": JSON},
        content=body,
    )


def sites() -> Call[SiteList]:
    """GET all sites."""
    return Call("GET", "/v1/sites", read_model(SiteList))


def site(name: Name) -> Call[Site]:
    """GET how a site is doing."""
    return Call("GET", site_path(name), read_model(Site))


def robots(site: Name) -> Call[RobotList]:
    """GET the robots of a site."""
    return Call("GET", f"{site_path(site)}/robots", read_model(RobotList))


def robot(site: Name, name: Name) -> Call[Robot]:
    """GET one robot."""
    return Call("GET", _robot(site, name), read_model(Robot))


def delete_robot(site: Name, robot: Name) -> Call[None]:
    """DELETE a robot, its scans and what rests on them."""
    return Call("DELETE", _robot(site, robot), read_nothing)


def delete_site(site: Name) -> Call[None]:
    """DELETE a site and all that was sent to it."""
    return Call("DELETE", site_path(site), read_nothing)


def trajectory(site: Name, robot: Name, align: bool, frame: MapFrame) -> Call[Trajectory]:
    """GET every processed scan's pose."""
    path, params = f"{_robot(site, robot)}/trajectory", _lying(align, frame)
    return Call("GET", path, read_model(Trajectory), params=params)


def trajectory_text(
    site: Name, robot: Name, format: Literal["tum", "csv"], align: bool, frame: MapFrame
) -> Call[str]:
    """GET the trajectory as text."""
    params = {"format": format} | _lying(align, frame)
    return Call("GET", f"{_robot(site, robot)}/trajectory", _text, params=params)


def transform(site: Name, robot_a: Name, robot_b: Name) -> Call[Transform]:
    """GET T_a_b."""
    path = f"{site_path(site)}/transforms/{url_name(robot_a)}/{url_name(robot_b)}"
    return Call("GET", path, read_model(Transform))


def map_lines(
    site: Name, component: str | None, bbox: Box | None, since: int | None = None
) -> Call[MapAnswer]:
    """GET the fused line map, or what changed in it after a version."""
    params = _map_params("json", component, bbox)
    if since is not None:
        params["since"] = str(since)
    return Call("GET", f"{site_path(site)}/map", read_model(MapAnswer), params=params)


def map_file(site: Name, format: MapFormat, options: MapOptions) -> Call[bytes]:
    """GET the map as a file."""
    params = _map_params(format, options.component, options.bbox)
    params |= _lying(options.align, options.frame)
    if options.resolution is not None:
        params["resolution"] = repr(float(options.resolution))
    return Call("GET", f"{site_path(site)}/map", read_bytes, params=params)


def graph(site: Name, align: bool, frame: MapFrame) -> Call[Graph]:
    """GET the pose graph."""
    params = _lying(align, frame)
    return Call("GET", f"{site_path(site)}/graph", read_model(Graph), params=params)


def graph_g2o(site: Name, align: bool, frame: MapFrame) -> Call[str]:
    """GET the pose graph as g2o text."""
    params = {"format": "g2o"} | _lying(align, frame)
    return Call("GET", f"{site_path(site)}/graph", _text, params=params)


def constraints(
    site: Name, kind: str | None, state: str | None, limit: int | None, cursor: str | None
) -> Call[ConstraintPage]:
    """GET a page of constraints."""
    wanted = {"kind": kind, "state": state, "limit": limit, "cursor": cursor}
    params = {name: str(value) for name, value in wanted.items() if value is not None}
    return Call("GET", f"{site_path(site)}/constraints", read_model(ConstraintPage), params=params)


def events(site: Name, follow: bool) -> Call[None]:
    """GET the stream of a site's events; `event_stream` reads it."""
    headers = {"Accept": "text/event-stream", "Cache-Control": "no-store"}
    params = {} if follow else {"follow": "false"}
    return Call("GET", f"{site_path(site)}/events", lambda _: None, params=params, headers=headers)


def constraint(site: Name, constraint_id: str) -> Call[ConstraintDetail]:
    """GET one constraint with its evidence."""
    return Call("GET", _constraint(site, constraint_id), read_model(ConstraintDetail))


def constraint_svg(site: Name, constraint_id: str) -> Call[str]:
    """GET a drawing of a constraint's evidence."""
    return Call("GET", _constraint(site, constraint_id), _text, params={"format": "svg"})


def act_on_constraint(
    site: Name, constraint_id: str, action: Literal["retract", "restore", "confirm"]
) -> Call[Constraint]:
    """POST that a constraint is to be retracted, restored, or believed."""
    return Call("POST", f"{_constraint(site, constraint_id)}/{action}", read_model(Constraint))


def what_if(site: Name, constraint_id: str) -> Call[WhatIf]:
    """POST the question what retracting (or restoring) a constraint would do."""
    return Call("POST", f"{_constraint(site, constraint_id)}/what-if", read_model(WhatIf))


def join(site: Name, request: JoinRequest) -> Call[Constraint]:
    """POST that two places are the same."""
    return _join(f"{site_path(site)}/constraints", request, Constraint)


def try_join(site: Name, request: JoinRequest) -> Call[JoinTrial]:
    """POST the question what a join would come to."""
    return _join(f"{site_path(site)}/constraints/what-if", request, JoinTrial)


def _join(path: str, request: JoinRequest, kind: type[_ModelT]) -> Call[_ModelT]:
    body = request.model_dump_json(exclude_none=True).encode()
    return Call("POST", path, read_model(kind), headers={"Content-Type": JSON}, content=body)


def match(reference: ScanLike, current: ScanLike) -> Call[MatchAnswer]:
    """POST two scans, to learn how they lie to each other."""
    request = MatchRequest.model_construct(
        reference=to_match_scan(reference), current=to_match_scan(current)
    )
    body = request.model_dump_json(exclude_none=True).encode()
    headers = {"Content-Type": JSON}
    return Call("POST", "/v1/match", read_model(MatchAnswer), headers=headers, content=body)


def localize(site: Name, scans: ScanLike | Sequence[ScanLike]) -> Call[LocalizeAnswer]:
    """POST a scan, or a run of one robot's scans, to learn where the latest was taken."""
    run = scans if isinstance(scans, Sequence) else [scans]
    request = LocalizeRequest.model_construct(scans=[to_match_scan(scan) for scan in run])
    return Call(
        "POST",
        f"{site_path(site)}/localize",
        read_model(LocalizeAnswer),
        headers={"Content-Type": JSON},
        content=request.model_dump_json(exclude_none=True).encode(),
    )


def ready() -> Call[Readiness]:
    """GET whether scans are taken and mapped. Not ready is an answer (503), not an error."""

    def read(response: httpx.Response) -> Readiness:
        if response.status_code not in (HTTPStatus.OK, HTTPStatus.SERVICE_UNAVAILABLE):
            raise_for_problem(response)
        try:
            return Readiness.model_validate_json(response.content)
        except ValidationError:
            return Readiness(
                takes_scans=False, maps=False, reasons=[f"status {response.status_code}"]
            )

    return Call("GET", "/readyz", read, retried=False)


def retry_after(response: httpx.Response) -> float | None:
    """Return how long the service asks to wait [s], where it does."""
    return parse_retry_after(response.headers.get("Retry-After"))


def raise_for_problem(response: httpx.Response) -> None:
    """Raise the ProblemError of an answer that is an error."""
    if response.status_code < 300:
        return
    if response.status_code < 400:
        where = response.headers.get("Location", "elsewhere")
        raise UnexpectedAnswerError(f"{response.url} has moved to {where}: use that address")
    try:
        problem = Problem.model_validate_json(response.content)
    except ValidationError:
        # Not Lineloom's own words: a proxy's, most likely.
        problem = Problem(
            type="about:blank",
            title=response.reason_phrase or "error",
            status=response.status_code,
            detail=response.text[:200].strip(),
        )
    raise problem_error(problem, retry_after(response))


def read_model(kind: type[_ModelT]) -> Callable[[httpx.Response], _ModelT]:
    """Return a reader of a model's JSON."""

    def read(response: httpx.Response) -> _ModelT:
        raise_for_problem(response)
        try:
            return kind.model_validate_json(response.content)
        except ValidationError as error:
            first = error.errors()[0]
            where = "/".join(str(part) for part in first["loc"]) or "the whole"
            raise UnexpectedAnswerError(
                f"{response.url} answered with something else than the contract's "
                f"{kind.__name__}: {where}: {first['msg']}"
            ) from error

    return read


def _text(response: httpx.Response) -> str:
    raise_for_problem(response)
    return response.text


def read_nothing(response: httpx.Response) -> None:
    """Read an answer that says nothing more."""
    raise_for_problem(response)


def read_bytes(response: httpx.Response) -> bytes:
    """Read an answer as it came."""
    raise_for_problem(response)
    return response.content


def _lying(align: bool, frame: MapFrame) -> dict[str, str]:
    """How the map lies, as far as it is not as it was made."""
    return ({"align": "true"} if align else {}) | ({"frame": frame} if frame != "map" else {})


def _map_params(format: str, component: str | None, bbox: Box | None) -> dict[str, str]:
    params = {"format": format}
    if component is not None:
        params["component"] = component
    if bbox is not None:
        params["bbox"] = ",".join(repr(float(value)) for value in bbox)
    return params


def site_path(name: Name) -> str:
    """Return the path of a site."""
    return f"/v1/sites/{url_name(name)}"


def _constraint(site: Name, constraint_id: str) -> str:
    return f"{site_path(site)}/constraints/{url_name(constraint_id)}"


def _robot(site: Name, robot: Name) -> str:
    return f"{site_path(site)}/robots/{url_name(robot)}"


def url_name(name: Name) -> str:
    """Return a name as it stands in a path; raises TypeError for what is neither word nor int."""
    return quote(name if isinstance(name, str) else str(operator.index(name)), safe="")
