"""POST …/scans: what is refused, with what status, and where the answer points."""

from __future__ import annotations

import gzip
import math
from collections.abc import AsyncIterator
from typing import Any

import httpx
import pytest
from lineloom_core.scan import MAX_BEAMS

from tests.contract.posting import JSON, MSGPACK, Make, expect_problem, post_scans

pytestmark = pytest.mark.asyncio(loop_scope="module")


MALFORMED: list[tuple[str, dict[str, Any], str]] = [
    ("seq below 0", {"seq": -1}, "/seq"),
    ("seq with a fraction", {"seq": 1.5}, "/seq"),
    ("seq as text", {"seq": "1"}, "/seq"),
    ("seq as a bool", {"seq": True}, "/seq"),
    ("seq beyond 64 bit", {"seq": 2**63}, "/seq"),
    ("session as a number", {"session": 1}, "/session"),
    ("session too long", {"session": "x" * 129}, "/session"),
    ("session with control characters", {"session": "a\x00b"}, "/session"),
    ("no stamp", {"stamp": ...}, "/stamp"),
    ("stamp null", {"stamp": None}, "/stamp"),
    ("stamp as text", {"stamp": "12.5"}, "/stamp"),
    ("stamp as a bool", {"stamp": False}, "/stamp"),
    ("stamp NaN", {"stamp": math.nan}, "/stamp"),
    ("stamp infinite", {"stamp": math.inf}, "/stamp"),
    ("stamp huge", {"stamp": 10**400}, "/stamp"),
    ("angle_min NaN", {"angle_min": math.nan}, "/angle_min"),
    ("angle_min in degrees", {"angle_min": -90.0}, "/angle_min"),
    ("no angle_increment", {"angle_increment": ...}, "/angle_increment"),
    ("angle_increment 0", {"angle_increment": 0.0}, "/angle_increment"),
    ("angle_increment infinite", {"angle_increment": -math.inf}, "/angle_increment"),
    ("more than a turn", {"angle_increment": 2.0}, "/angle_increment"),
    ("angle_max that disagrees", {"angle_max": 2.0}, "/angle_max"),
    ("angle_max NaN", {"angle_max": math.nan}, "/angle_max"),
    ("range_min below 0", {"range_min": -0.1}, "/range_min"),
    ("range_max below range_min", {"range_max": 0.1}, "/range_max"),
    ("range_max infinite", {"range_max": math.inf}, "/range_max"),
    ("no ranges", {"ranges": ...}, "/ranges"),
    ("ranges empty", {"ranges": []}, "/ranges"),
    ("ranges null", {"ranges": None}, "/ranges"),
    ("ranges as text", {"ranges": "1,2,3"}, "/ranges"),
    ("ranges nested", {"ranges": [[1.0, 2.0]]}, "/ranges/0"),
    ("a range as text", {"ranges": [1.0, "2.0"]}, "/ranges/1"),
    ("a range as a bool", {"ranges": [1.0, 1.0, False]}, "/ranges/2"),
    ("a range NaN", {"ranges": [1.0, math.nan]}, "/ranges/1"),
    ("a range as bare Infinity", {"ranges": [math.inf, 1.0]}, "/ranges/0"),
    ("a range huge", {"ranges": [1.0, 10**400]}, "/ranges/1"),
    ("other words than inf", {"ranges": [1.0, "Infinity"]}, "/ranges/1"),
    ("too many beams", {"ranges": [1.0] * (MAX_BEAMS + 1), "angle_increment": 1e-5}, "/ranges"),
    ("a million beams", {"ranges": [1.0] * 1_000_000, "angle_increment": 1e-7}, "/ranges"),
    ("time_increment below 0", {"time_increment": -1e-3}, "/time_increment"),
    ("scan_time NaN", {"scan_time": math.nan}, "/scan_time"),
    ("odometry as a list", {"odometry": [1, 2, 3]}, "/odometry"),
    ("odometry in part", {"odometry": {"x": 1.0, "y": 2.0}}, "/odometry/theta"),
    ("odometry NaN", {"odometry": {"x": math.nan, "y": 0.0, "theta": 0.0}}, "/odometry/x"),
    ("odometry as text", {"odometry": {"x": 0, "y": 0, "theta": "0"}}, "/odometry/theta"),
]


@pytest.mark.parametrize(
    ("changes", "pointer"), [m[1:] for m in MALFORMED], ids=[m[0] for m in MALFORMED]
)
async def test_a_malformed_field_is_pointed_at(
    client: httpx.AsyncClient, site: str, make_scan: Make, changes: dict[str, Any], pointer: str
) -> None:
    scan = make_scan(0, **changes)
    problem = expect_problem(await post_scans(client, site, scan), 422, "invalid-body")
    assert pointer in [error["pointer"] for error in problem["errors"]]
    assert all(error["reason"] for error in problem["errors"])
    problem = expect_problem(await post_scans(client, site, {"scans": [scan]}), 422, "invalid-body")
    assert f"/scans/0{pointer}" in [error["pointer"] for error in problem["errors"]]
    assert (await client.get(f"/v1/sites/{site}")).status_code == 404


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ([], ""),
        ("scan", ""),
        (None, ""),
        (7, ""),
        ({}, "/stamp"),
        ({"scans": []}, "/scans"),
        ({"scans": {}}, "/scans"),
        ({"scans": None}, "/scans"),
        ({"scans": [None]}, "/scans/0"),
        ({"scans": [[]] * 1001}, "/scans"),
    ],
)
async def test_a_body_of_another_shape_is_pointed_at(
    client: httpx.AsyncClient, site: str, body: Any, pointer: str
) -> None:
    problem = expect_problem(await post_scans(client, site, body), 422, "invalid-body")
    assert pointer in [error["pointer"] for error in problem["errors"]]


@pytest.mark.parametrize(
    ("body", "headers"),
    [
        (b"", JSON),
        (b"{", JSON),
        (b'{"seq": 1,}', JSON),
        (b"\xff\xfe", JSON),
        (b"[" * 100_000, JSON),
        (b"", MSGPACK),
        (b"\xc1", MSGPACK),
        (b"\x81", MSGPACK),
        (b"\x01\x02", MSGPACK),
        (b"\x91" * 100_000, MSGPACK),
        (b"\xa1\xff", MSGPACK),
        (b"\xdd\xff\xff\xff\xff", MSGPACK),
        (b"\x81\x90\x01", MSGPACK),
        (b"not gzip", {**JSON, "Content-Encoding": "gzip"}),
        (gzip.compress(b'{"seq": 1}', mtime=0)[:-4], {**JSON, "Content-Encoding": "gzip"}),
    ],
)
async def test_bytes_that_cannot_be_read(
    client: httpx.AsyncClient, site: str, body: bytes, headers: dict[str, str]
) -> None:
    expect_problem(await post_scans(client, site, body, headers), 400, "malformed-body")


@pytest.mark.parametrize("content_type", ["", "text/plain", "application/x-www-form-urlencoded"])
async def test_other_content_types_are_refused(
    client: httpx.AsyncClient, site: str, content_type: str
) -> None:
    response = await post_scans(client, site, {}, {"Content-Type": content_type})
    expect_problem(response, 415, "unsupported-media-type")


async def test_a_content_type_with_parameters_is_understood(
    client: httpx.AsyncClient, site: str, make_scan: Make
) -> None:
    headers = {"Content-Type": "Application/JSON; charset=utf-8"}
    assert (await post_scans(client, site, make_scan(0), headers)).status_code == 202


async def test_other_encodings_are_refused(client: httpx.AsyncClient, site: str) -> None:
    response = await post_scans(client, site, {}, {**JSON, "Content-Encoding": "br"})
    expect_problem(response, 415, "unsupported-content-encoding")


async def test_a_body_that_says_it_is_too_large_is_not_read(
    client: httpx.AsyncClient, site: str
) -> None:
    async def body() -> AsyncIterator[bytes]:
        raise AssertionError("was read")
        yield b""

    headers = {**JSON, "Content-Length": str(16 * 1024 * 1024 + 1)}
    response = await client.post(
        f"/v1/sites/{site}/robots/r/scans", content=body(), headers=headers
    )
    expect_problem(response, 413, "too-large")


async def test_a_gzip_bomb_is_not_inflated(client: httpx.AsyncClient, site: str) -> None:
    bomb = gzip.compress(b" " * (200 * 1024 * 1024), compresslevel=9)
    assert len(bomb) < 300_000
    response = await post_scans(client, site, bomb, {**JSON, "Content-Encoding": "gzip"})
    expect_problem(response, 413, "too-large")


@pytest.mark.parametrize("name", ["-a", ".a", "a b", "a" * 65, "ä", "a%0A", "a%00"])
async def test_names_outside_the_pattern_are_refused(
    client: httpx.AsyncClient, make_scan: Make, name: str
) -> None:
    for path in (f"/v1/sites/{name}/robots/r/scans", f"/v1/sites/s/robots/{name}/scans"):
        response = await client.post(path, json=make_scan(0))
        expect_problem(response, 422, "invalid-parameter")
