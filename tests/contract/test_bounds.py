"""What is small to send and would be large to deal with: refused soon, and nobody waits for it."""

from __future__ import annotations

import asyncio
import gzip
import resource
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import msgpack
import pytest
from lineloom_service.app import create_app
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.security.token_book import create_token
from lineloom_service.service import Service
from lineloom_service.settings import Settings

from tests.contract.posting import MSGPACK, expect_problem, post_scans

pytestmark = pytest.mark.asyncio(loop_scope="module")

Make = Callable[..., dict[str, Any]]
Idle = Callable[[str], Awaitable[dict[str, Any]]]


@pytest.mark.parametrize(
    "body",
    [
        {"scans": [{}] * 99_999},
        {"scans": [[{}] * 90_000] * 100},
        {"scans": [["ab"] * 99_999] * 40},
        {"scans": [{"ranges": [[]] * 90_000}] * 40},
    ],
    ids=["objects", "lists of objects", "texts", "lists"],
)
async def test_bodies_that_are_large_only_when_they_are_decoded(
    client: httpx.AsyncClient, site: str, body: Any
) -> None:
    packed = gzip.compress(msgpack.packb(body), 1)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begin = time.process_time()
    answer = await post_scans(
        client, site, packed, {"Content-Type": MSGPACK["Content-Type"], "Content-Encoding": "gzip"}
    )
    taken = time.process_time() - begin
    problem = expect_problem(answer, answer.status_code, answer.json()["type"].split("/")[-1])
    assert problem["status"] in (413, 422)
    assert taken < 1.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000  # kB


@pytest.mark.parametrize("box", ["0,0,1,3e11", "0,0,1,1e300", "-1e300,0,1,1", "0,0,1e-300,1e9"])
@pytest.mark.parametrize("form", ["png", "svg", "json", "nav2", "dxf"])
async def test_parts_of_a_map_that_are_out_of_this_world(
    client: httpx.AsyncClient, make_scan: Make, idle: Idle, box: str, form: str
) -> None:
    await client.post("/v1/sites/world/robots/r/scans", json=make_scan(0))
    await idle("world")
    answer = await client.get(f"/v1/sites/world/map?format={form}&bbox={box}")
    expect_problem(answer, 422, "invalid-parameter")


async def test_a_token_that_asks_too_much_is_told_so_and_the_others_are_not(
    tmp_path: Path,
) -> None:
    settings = Settings(data_dir=tmp_path, token_rate=2.0, token_requests=2)
    engine = LocalEngine(1, mapper="fake_mapper:FakeMapper", warm_up=None)
    service = Service(settings, engine=engine)
    await service.start()
    tokens = [
        (await service.store.write_apart(create_token, ["read"], site=None, robot=None, note=""))[0]
        for _ in range(3)
    ]
    await service.guard._refresh()
    transport = httpx.ASGITransport(create_app(service=service))
    async with httpx.AsyncClient(transport=transport, base_url="http://lineloom") as client:

        async def ask(token: str) -> httpx.Response:
            return await client.get("/v1/sites", headers={"Authorization": f"Bearer {token}"})

        answers = await asyncio.gather(*(ask(tokens[0]) for _ in range(40)))
        passed = [answer.status_code for answer in answers].count(200)
        assert 4 <= passed < 40  # two seconds' worth, and two a second
        refused = next(answer for answer in answers if answer.status_code != 200)
        problem = expect_problem(refused, 429, "too-many-requests")
        assert "2 requests a second" in problem["detail"]
        assert refused.headers["retry-after"] == "1"
        assert (await ask(tokens[1])).status_code == 200

        release = asyncio.Event()
        sites = service.store.sites

        async def slow() -> Any:
            await release.wait()
            return await sites()

        service.store.sites = slow  # type: ignore[method-assign]
        held = [asyncio.ensure_future(ask(tokens[2])) for _ in range(2)]
        await asyncio.sleep(0.05)
        problem = expect_problem(await ask(tokens[2]), 429, "too-many-requests")
        assert "2 requests at a time" in problem["detail"]
        release.set()
        assert [answer.status_code for answer in await asyncio.gather(*held)] == [200, 200]
        assert (await ask(tokens[2])).status_code == 200
    await service.stop()
