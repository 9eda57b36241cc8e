"""POST …/scans as the contract has it: what is taken, what is refused, and in which words."""

from __future__ import annotations

import asyncio
import gzip
import json
import math
from array import array
from collections.abc import AsyncIterator, Awaitable, Callable
from itertools import count
from typing import Any

import httpx
import msgpack
import pytest
from lineloom import wire
from lineloom_core.scan import MAX_BEAMS
from lineloom_service.service import Service
from lineloom_service.store.codec import decode_scan

pytestmark = pytest.mark.asyncio(loop_scope="module")

Make = Callable[..., dict[str, Any]]
Idle = Callable[[str], Awaitable[dict[str, Any]]]
_NUMBERS = count()

JSON = {"Content-Type": "application/json"}
MSGPACK = {"Content-Type": "application/msgpack"}


@pytest.fixture
def site() -> str:
    """A site that no other test uses."""
    return f"site-{next(_NUMBERS)}"


async def _post(
    client: httpx.AsyncClient, site: str, body: Any, headers: dict[str, str] | None = None
) -> httpx.Response:
    content = body if isinstance(body, bytes) else json.dumps(body).encode()
    return await client.post(
        f"/v1/sites/{site}/robots/r/scans", content=content, headers=headers or JSON
    )


def _problem(response: httpx.Response, status: int, slug: str) -> dict[str, Any]:
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    problem: dict[str, Any] = response.json()
    assert problem["type"] == f"/problems/{slug}"
    assert problem["status"] == status
    assert problem["title"]
    assert problem["detail"]
    return problem


async def _stored(service: Service, site: str) -> list[Any]:
    record = await service.store.site(site)
    assert record is not None
    entries = await service.store.read_feed(record.id, 0, 10_000)
    return [decode_scan(e.body or b"", e.session or "", e.seq or 0) for e in entries]


async def test_one_scan_is_taken_and_mapped(
    client: httpx.AsyncClient, site: str, make_scan: Make, idle: Idle
) -> None:
    response = await _post(client, site, make_scan(0))
    assert response.status_code == 202
    assert response.json() == {"accepted": 1, "duplicates": 0, "rejected": [], "pending": 1}
    answer = await idle(site)
    assert answer["scans"] == {"accepted": 1, "processed": 1, "pending": 0, "skipped": 0}
    assert answer["robots"] == ["r"]


async def test_sending_again_is_harmless(
    client: httpx.AsyncClient, site: str, make_scan: Make, idle: Idle
) -> None:
    batch = {"scans": [make_scan(seq) for seq in range(5)]}
    assert (await _post(client, site, batch)).json()["accepted"] == 5
    again = (await _post(client, site, batch)).json()
    assert (again["accepted"], again["duplicates"]) == (0, 5)
    assert (await idle(site))["version"] == 5


async def test_a_batch_takes_the_good_scans_and_lists_the_others(
    client: httpx.AsyncClient, site: str, make_scan: Make
) -> None:
    scans = [
        make_scan(0),
        make_scan(1, angle_increment=0),
        make_scan(2, ranges=[1.0, True]),
        "not a scan",
        make_scan(4, seq=-4),
        make_scan(1),
    ]
    response = await _post(client, site, {"scans": scans})
    assert response.status_code == 202
    answer = response.json()
    assert answer["accepted"] == 2
    assert [(r["index"], r["seq"]) for r in answer["rejected"]] == [
        (1, 1),
        (2, 2),
        (3, None),
        (4, None),
    ]
    assert answer["rejected"][0]["reason"] == "angle_increment: must not be 0"
    assert answer["rejected"][1]["reason"].startswith("ranges/1: ")
    assert answer["rejected"][2]["reason"].startswith("scan: ")
    assert answer["rejected"][3]["reason"].startswith("seq: ")


async def test_a_batch_without_a_good_scan_is_refused_with_all_its_faults(
    client: httpx.AsyncClient, site: str, make_scan: Make
) -> None:
    body = {"scans": [make_scan(0, stamp="1.0"), make_scan(1, range_max=0.05)]}
    problem = _problem(await _post(client, site, body), 422, "invalid-body")
    assert [e["pointer"] for e in problem["errors"]] == ["/scans/0/stamp", "/scans/1/range_max"]
    assert (await client.get(f"/v1/sites/{site}")).status_code == 404


MALFORMED: list[tuple[str, dict[str, Any], str]] = [
    ("no seq", {"seq": ...}, "/seq"),
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
    problem = _problem(await _post(client, site, scan), 422, "invalid-body")
    assert pointer in [error["pointer"] for error in problem["errors"]]
    assert all(error["reason"] for error in problem["errors"])
    problem = _problem(await _post(client, site, {"scans": [scan]}), 422, "invalid-body")
    assert f"/scans/0{pointer}" in [error["pointer"] for error in problem["errors"]]
    assert (await client.get(f"/v1/sites/{site}")).status_code == 404


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ([], ""),
        ("scan", ""),
        (None, ""),
        (7, ""),
        ({}, "/seq"),
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
    problem = _problem(await _post(client, site, body), 422, "invalid-body")
    assert pointer in [error["pointer"] for error in problem["errors"]]


async def test_what_ranges_mean(
    client: httpx.AsyncClient, service: Service, site: str, make_scan: Make
) -> None:
    ranges = [1.5, None, "inf", "-inf", 30.0, 31, 0.05, 0.1]
    assert (await _post(client, site, make_scan(0, ranges=ranges))).status_code == 202
    (scan,) = await _stored(service, site)
    expected = [1.5, math.nan, math.inf, -math.inf, math.inf, math.inf, -math.inf, 0.1]
    assert [repr(v) for v in scan.ranges.tolist()] == [repr(v) for v in expected]


async def test_only_no_returns_and_changing_beam_counts_are_fine(
    client: httpx.AsyncClient, site: str, make_scan: Make, idle: Idle
) -> None:
    scans = [
        make_scan(0, ranges=["inf"] * 5),
        make_scan(1, ranges=[None] * 9),
        make_scan(2, ranges=[1.0], angle_increment=-0.01),
        make_scan(3, stamp=5.0),
        make_scan(4, stamp=4.0, angle_max=1.0),
        make_scan(5, intensities=[1, 2, 3]),
    ]
    answer = (await _post(client, site, {"scans": scans})).json()
    assert (answer["accepted"], answer["rejected"]) == (6, [])
    assert (await idle(site))["scans"]["processed"] == 6


async def test_json_and_msgpack_carry_the_same_scans(
    client: httpx.AsyncClient, service: Service, site: str
) -> None:
    scans = [
        wire.Scan(
            seq=seq,
            stamp=0.1 * seq,
            angle_min=-1.0,
            angle_increment=0.3,
            range_min=0.1,
            range_max=30.0,
            ranges=ranges,
            odometry=wire.Odometry(x=0.1, y=0.2, theta=0.3),
        )
        for seq, ranges in enumerate(
            ([1.1, 2.2, math.nan, math.inf], [0.5, 0.25, math.nan, -math.inf])
        )
    ]
    headers = {**MSGPACK, "Content-Encoding": "gzip"}
    assert (await _post(client, site, wire.pack_json(scans))).json()["accepted"] == 2
    packed = gzip.compress(wire.pack_msgpack(scans))
    other = await _post(client, f"{site}-m", packed, headers)
    assert other.json()["accepted"] == 2
    pairs = zip(await _stored(service, site), await _stored(service, f"{site}-m"), strict=True)
    for a, b in pairs:
        assert a.ranges.tobytes() == b.ranges.tobytes()
        assert (a.stamp, a.odometry) == (b.stamp, b.odometry)


async def test_msgpack_takes_packed_floats_and_nan(
    client: httpx.AsyncClient, service: Service, site: str, make_scan: Make
) -> None:
    packed = array("f", [1.5, math.nan, math.inf, 2.0, 0.01]).tobytes()
    body = msgpack.packb({"scans": [make_scan(0, ranges=packed)]})
    assert (await _post(client, site, body, MSGPACK)).status_code == 202
    (scan,) = await _stored(service, site)
    assert repr(scan.ranges.tolist()) == repr([1.5, math.nan, math.inf, 2.0, -math.inf])
    for ranges in (b"", b"123", b"\x00" * 4 * (MAX_BEAMS + 1), [b"1"], [msgpack.Timestamp(1)]):
        body = msgpack.packb(make_scan(1, ranges=ranges))
        _problem(await _post(client, site, body, MSGPACK), 422, "invalid-body")


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
        (gzip.compress(b'{"seq": 1}')[:-4], {**JSON, "Content-Encoding": "gzip"}),
    ],
)
async def test_bytes_that_cannot_be_read(
    client: httpx.AsyncClient, site: str, body: bytes, headers: dict[str, str]
) -> None:
    _problem(await _post(client, site, body, headers), 400, "malformed-body")


@pytest.mark.parametrize("content_type", ["", "text/plain", "application/x-www-form-urlencoded"])
async def test_other_content_types_are_refused(
    client: httpx.AsyncClient, site: str, content_type: str
) -> None:
    response = await _post(client, site, {}, {"Content-Type": content_type})
    _problem(response, 415, "unsupported-media-type")


async def test_a_content_type_with_parameters_is_understood(
    client: httpx.AsyncClient, site: str, make_scan: Make
) -> None:
    headers = {"Content-Type": "Application/JSON; charset=utf-8"}
    assert (await _post(client, site, make_scan(0), headers)).status_code == 202


async def test_other_encodings_are_refused(client: httpx.AsyncClient, site: str) -> None:
    response = await _post(client, site, {}, {**JSON, "Content-Encoding": "br"})
    _problem(response, 415, "unsupported-content-encoding")


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
    _problem(response, 413, "too-large")


async def test_a_gzip_bomb_is_not_inflated(client: httpx.AsyncClient, site: str) -> None:
    bomb = gzip.compress(b" " * (200 * 1024 * 1024), compresslevel=9)
    assert len(bomb) < 300_000
    response = await _post(client, site, bomb, {**JSON, "Content-Encoding": "gzip"})
    _problem(response, 413, "too-large")


async def test_out_of_order_batches_are_mapped_in_order(
    client: httpx.AsyncClient, service: Service, site: str, make_scan: Make, idle: Idle
) -> None:
    for seqs in ([2, 1], [5, 3], [0], [4]):
        await _post(client, site, {"scans": [make_scan(seq) for seq in seqs]})
    await idle(site)
    assert [scan.seq for scan in await _stored(service, site)] == [0, 1, 2, 3, 4, 5]


async def test_held_scans_are_pending_and_in_time_mapped(
    client: httpx.AsyncClient, site: str, make_scan: Make, idle: Idle
) -> None:
    answer = (await _post(client, site, {"scans": [make_scan(s) for s in (0, 2, 4)]})).json()
    assert answer["accepted"] == 3
    await asyncio.sleep(0.1)
    now = (await client.get(f"/v1/sites/{site}")).json()
    assert now["scans"] == {"accepted": 3, "processed": 1, "pending": 2, "skipped": 0}
    assert not now["idle"]
    robot = (await client.get(f"/v1/sites/{site}/robots/r")).json()
    assert robot["scans"]["pending"] == 2
    assert "2 scans wait for those with lower seq" in robot["health"]
    assert (await idle(site))["scans"]["processed"] == 3


async def test_a_full_backlog_is_429_and_takes_nothing(
    client: httpx.AsyncClient, service: Service, site: str, make_scan: Make, idle: Idle
) -> None:
    first = {"scans": [make_scan(seq) for seq in range(1, 451)]}  # held: 0 is missing
    assert (await _post(client, site, first)).status_code == 202
    second = {"scans": [make_scan(seq) for seq in range(450, 550)]}
    response = await _post(client, site, second)
    _problem(response, 429, "backlog-full")
    assert int(response.headers["retry-after"]) >= 1
    record = await service.store.site(site)
    assert record is not None
    assert record.accepted == 450
    await idle(site)
    assert (await _post(client, site, second)).json()["accepted"] == 99


@pytest.mark.parametrize("name", ["-a", ".a", "a b", "a" * 65, "ä", "a%0A", "a%00"])
async def test_names_outside_the_pattern_are_refused(
    client: httpx.AsyncClient, make_scan: Make, name: str
) -> None:
    for path in (f"/v1/sites/{name}/robots/r/scans", f"/v1/sites/s/robots/{name}/scans"):
        response = await client.post(path, json=make_scan(0))
        _problem(response, 422, "invalid-parameter")


async def test_every_allowed_name_works(client: httpx.AsyncClient, make_scan: Make) -> None:
    response = await client.post("/v1/sites/A.b_c-9/robots/9/scans", json=make_scan(0))
    assert response.status_code == 202


async def test_concurrent_senders_lose_nothing(
    client: httpx.AsyncClient, site: str, make_scan: Make, idle: Idle
) -> None:
    async def robot(name: str) -> None:
        for seq in range(20):
            response = await client.post(
                f"/v1/sites/{site}/robots/{name}/scans", json=make_scan(seq)
            )
            assert response.status_code == 202

    await asyncio.gather(*(robot(f"r{number}") for number in range(8)))
    answer = await idle(site)
    assert answer["scans"]["processed"] == answer["version"] == 160


async def test_client_and_core_agree_on_the_largest_scan() -> None:
    assert wire.MAX_BEAMS == MAX_BEAMS
