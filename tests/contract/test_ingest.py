"""POST …/scans as the contract has it: what is taken, and what becomes of it."""

from __future__ import annotations

import asyncio
import gzip
import math
from array import array
from typing import Any

import httpx
import msgpack
import pytest
from lineloom import wire
from lineloom_core.scan import MAX_BEAMS
from lineloom_service.service import Service
from lineloom_service.store.codec import decode_scan
from lineloom_service.store.reads import read_feed

from tests.contract.posting import MSGPACK, Idle, Make, expect_problem, post_scans

pytestmark = pytest.mark.asyncio(loop_scope="module")


async def _stored(service: Service, site: str) -> list[Any]:
    record = await service.store.site(site)
    assert record is not None
    entries = await service.store.read(read_feed, record.id, 0, 10_000)
    return [decode_scan(e.body or b"", e.session or "", e.seq or 0) for e in entries]


async def test_one_scan_is_taken_and_mapped(
    client: httpx.AsyncClient, site: str, make_scan: Make, idle: Idle
) -> None:
    response = await post_scans(client, site, make_scan(0))
    assert response.status_code == 202
    counts = {"accepted": 1, "duplicates": 0, "rejected": [], "pending": 1}
    assert response.json() == {**counts, "suggested_rate_hz": None}
    answer = await idle(site)
    assert answer["scans"] == {"accepted": 1, "processed": 1, "pending": 0, "skipped": 0}
    assert answer["robots"] == ["r"]


async def test_sending_again_is_harmless(
    client: httpx.AsyncClient, site: str, make_scan: Make, idle: Idle
) -> None:
    batch = {"scans": [make_scan(seq) for seq in range(5)]}
    assert (await post_scans(client, site, batch)).json()["accepted"] == 5
    again = (await post_scans(client, site, batch)).json()
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
    response = await post_scans(client, site, {"scans": scans})
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
    problem = expect_problem(await post_scans(client, site, body), 422, "invalid-body")
    assert [e["pointer"] for e in problem["errors"]] == ["/scans/0/stamp", "/scans/1/range_max"]
    assert (await client.get(f"/v1/sites/{site}")).status_code == 404


async def test_what_ranges_mean(
    client: httpx.AsyncClient, service: Service, site: str, make_scan: Make
) -> None:
    ranges = [1.5, None, "inf", "-inf", 30.0, 31, 0.05, 0.1]
    assert (await post_scans(client, site, make_scan(0, ranges=ranges))).status_code == 202
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
    answer = (await post_scans(client, site, {"scans": scans})).json()
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
    assert (await post_scans(client, site, wire.pack_json(scans))).json()["accepted"] == 2
    packed = gzip.compress(wire.pack_msgpack(scans))
    other = await post_scans(client, f"{site}-m", packed, headers)
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
    assert (await post_scans(client, site, body, MSGPACK)).status_code == 202
    (scan,) = await _stored(service, site)
    assert repr(scan.ranges.tolist()) == repr([1.5, math.nan, math.inf, 2.0, -math.inf])
    for ranges in (b"", b"123", b"\x00" * 4 * (MAX_BEAMS + 1), [b"1"], [msgpack.Timestamp(1)]):
        body = msgpack.packb(make_scan(1, ranges=ranges))
        expect_problem(await post_scans(client, site, body, MSGPACK), 422, "invalid-body")


async def test_out_of_order_batches_are_mapped_in_order(
    client: httpx.AsyncClient, service: Service, site: str, make_scan: Make, idle: Idle
) -> None:
    for seqs in ([2, 1], [5, 3], [0], [4]):
        await post_scans(client, site, {"scans": [make_scan(seq) for seq in seqs]})
    await idle(site)
    assert [scan.seq for scan in await _stored(service, site)] == [0, 1, 2, 3, 4, 5]


async def test_held_scans_are_pending_and_in_time_mapped(
    client: httpx.AsyncClient, site: str, make_scan: Make, idle: Idle
) -> None:
    await post_scans(client, f"{site}-first", make_scan())
    await idle(f"{site}-first")  # the worker has started
    answer = (await post_scans(client, site, {"scans": [make_scan(s) for s in (0, 2, 4)]})).json()
    assert answer["accepted"] == 3
    for _ in range(100):  # the first one is mapped at once
        now = (await client.get(f"/v1/sites/{site}")).json()
        if now["scans"]["processed"]:
            break
        await asyncio.sleep(0.01)
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
    assert (await post_scans(client, site, first)).status_code == 202
    second = {"scans": [make_scan(seq) for seq in range(450, 550)]}
    response = await post_scans(client, site, second)
    expect_problem(response, 429, "backlog-full")
    assert int(response.headers["retry-after"]) >= 1
    record = await service.store.site(site)
    assert record is not None
    assert record.accepted == 450
    await idle(site)
    assert (await post_scans(client, site, second)).json()["accepted"] == 99


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
