"""How scans are named: by session and seq, or by the service, and what is told of a conflict."""

from __future__ import annotations

from array import array
from typing import Any

import httpx
import msgpack
import pytest
from lineloom import wire

from tests.contract.posting import MSGPACK, Idle, Make, post_scans

pytestmark = pytest.mark.asyncio(loop_scope="module")


async def _robot(client: httpx.AsyncClient, site: str) -> dict[str, Any]:
    answer: dict[str, Any] = (await client.get(f"/v1/sites/{site}/robots/r")).json()
    return answer


async def _seqs(client: httpx.AsyncClient, site: str) -> list[tuple[int, float]]:
    answer = await client.get(f"/v1/sites/{site}/robots/r/trajectory")
    return [(pose["seq"], pose["stamp"]) for pose in answer.json()["poses"]]


async def test_another_scan_under_a_name_that_is_taken_is_told(
    client: httpx.AsyncClient, site: str, make_scan: Make, idle: Idle
) -> None:
    await post_scans(client, site, {"scans": [make_scan(0), make_scan(1)]})
    other = make_scan(7, seq=1, stamp=7.5)
    answer = (await post_scans(client, site, {"scans": [make_scan(0), other, make_scan(2)]})).json()
    assert (answer["accepted"], answer["duplicates"]) == (1, 1)
    (refused,) = answer["rejected"]
    assert (refused["index"], refused["seq"], refused["reason"]) == (1, 1, "conflict")
    assert refused["pointer"] == "/scans/1/seq"
    assert "7.5" in refused["detail"]
    assert "leave seq out" in refused["detail"]
    alone = (await post_scans(client, site, other)).json()
    assert [(r["reason"], r["pointer"]) for r in alone["rejected"]] == [("conflict", "/seq")]
    assert (await idle(site))["scans"]["processed"] == 3
    metrics = (await client.get("/metrics")).text
    assert 'lineloom_scans_refused_total{reason="conflict"}' in metrics


async def test_two_of_one_name_in_one_request_are_a_conflict_as_well(
    client: httpx.AsyncClient, site: str, make_scan: Make
) -> None:
    scans = [make_scan(0), make_scan(1, seq=0), make_scan(0), make_scan(0, session="other")]
    answer = (await post_scans(client, site, {"scans": scans})).json()
    assert (answer["accepted"], answer["duplicates"]) == (2, 1)
    assert [(r["index"], r["reason"]) for r in answer["rejected"]] == [(1, "conflict")]


async def test_a_seq_that_never_grows_is_in_the_robots_health_until_it_does(
    client: httpx.AsyncClient, site: str, make_scan: Make, idle: Idle
) -> None:
    scans = [make_scan(number, seq=0) for number in range(30)]
    answer = (await post_scans(client, site, {"scans": scans})).json()
    assert (answer["accepted"], len(answer["rejected"])) == (1, 29)
    (said,) = [text for text in (await _robot(client, site))["health"] if "conflict" in text]
    assert "seq is 0 again and again" in said
    await idle(site)
    await post_scans(client, site, {"scans": [make_scan(number) for number in range(1, 600)]})
    assert not any("conflict" in text for text in (await _robot(client, site))["health"])


async def test_a_counter_that_begins_again_is_told_apart(
    client: httpx.AsyncClient, site: str, make_scan: Make
) -> None:
    await post_scans(client, site, {"scans": [make_scan(n) for n in range(20)]})
    again = {"scans": [make_scan(20 + n, seq=n) for n in range(20)]}
    assert len((await post_scans(client, site, again)).json()["rejected"]) == 20
    assert any("another session" in text for text in (await _robot(client, site))["health"])
    await client.delete(f"/v1/sites/{site}/robots/r")
    await post_scans(client, site, make_scan(0))
    assert not any("conflict" in text for text in (await _robot(client, site))["health"])


async def test_a_scan_in_decimals_and_as_float32_is_the_same(
    client: httpx.AsyncClient, site: str, make_scan: Make
) -> None:
    scan = make_scan(0)
    single = array("f", (r if isinstance(r, float) else 5.0 for r in scan["ranges"]))
    first = wire.Scan.model_validate({**scan, "ranges": single})
    await post_scans(client, site, first.model_dump(mode="json"))
    decimals = {**scan, "ranges": [round(r, 6) for r in single]}
    answer = (await post_scans(client, site, decimals)).json()
    assert (answer["duplicates"], answer["rejected"]) == (1, [])
    body = {**scan, "ranges": single.tobytes()}
    packed = await post_scans(client, site, msgpack.packb(body), MSGPACK)
    assert packed.json()["duplicates"] == 1


async def test_without_seq_the_service_counts_by_stamp_and_arrival(
    client: httpx.AsyncClient, site: str, make_scan: Make, idle: Idle
) -> None:
    def bare(number: int, stamp: float) -> dict[str, Any]:
        ranges = [2.0 + number, *make_scan()["ranges"][1:]]
        scan = make_scan(number, stamp=stamp, ranges=ranges)
        del scan["seq"]
        return scan

    first = {"scans": [bare(2, 2.0), bare(0, 0.0), bare(1, 1.0)]}
    assert (await post_scans(client, site, first)).json()["accepted"] == 3
    second = {"scans": [bare(4, 3.0), bare(3, 3.0), bare(2, 2.0)]}
    answer = (await post_scans(client, site, second)).json()
    assert (answer["accepted"], answer["duplicates"], answer["rejected"]) == (2, 1, [])
    assert (await post_scans(client, site, first)).json()["duplicates"] == 3, "harmless as ever"
    await idle(site)
    assert await _seqs(client, site) == [(0, 0.0), (1, 1.0), (2, 2.0), (3, 3.0), (4, 3.0)]
    numbered = (await post_scans(client, site, make_scan(9, seq=5))).json()
    assert numbered["accepted"] == 1
    assert (await post_scans(client, site, bare(10, 10.0))).json()["accepted"] == 1
    await idle(site)
    assert [seq for seq, _ in await _seqs(client, site)] == [0, 1, 2, 3, 4, 5, 6]
