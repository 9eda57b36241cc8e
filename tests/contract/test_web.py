"""What a browser could be made to do, and what goes out to where somebody else reads it."""

from __future__ import annotations

import csv
import io
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
import pytest_asyncio
from lineloom_service.app import create_app
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.security.token_book import create_token
from lineloom_service.service import Service
from lineloom_service.settings import Settings

from tests.contract.posting import expect_problem

pytestmark = pytest.mark.asyncio(loop_scope="module")

Make = Callable[..., dict[str, Any]]
Idle = Callable[[str], Awaitable[dict[str, Any]]]

HOME = "/v1/sites/home"


@pytest_asyncio.fixture(scope="module", loop_scope="module", autouse=True)
async def _home(client: httpx.AsyncClient, make_scan: Make, idle: Idle) -> None:
    for session in ("=1+2", "0"):
        scan = make_scan(0, session=session)
        (await client.post(f"{HOME}/robots/a/scans", json=scan)).raise_for_status()
    await idle("home")


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8765", "[::1]:8765", "10.1.2.3", "localhost", "lineloom:8765", "nas.local"]
)
async def test_own_names_are_known(client: httpx.AsyncClient, host: str) -> None:
    assert (await client.get(HOME, headers={"Host": host})).status_code == 200


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8765", "127.0.0.1.evil.example"])
async def test_a_name_from_elsewhere_is_not(client: httpx.AsyncClient, host: str) -> None:
    for method, path in (("GET", HOME), ("GET", f"{HOME}/events"), ("DELETE", HOME)):
        answer = await client.request(method, path, headers={"Host": host})
        problem = expect_problem(answer, 421, "unknown-host")
        assert "LINELOOM_ALLOW_HOSTS" in problem["detail"]
    assert (await client.get("/healthz", headers={"Host": host})).status_code == 200
    assert (await client.get(HOME)).status_code == 200


FOREIGN = [
    {"Origin": "https://evil.example"},
    {"Origin": "null"},
    {"Origin": "http://lineloom.evil.example"},
    {"Sec-Fetch-Site": "cross-site"},
]


@pytest.mark.parametrize("headers", FOREIGN)
async def test_another_origins_page_changes_nothing(
    client: httpx.AsyncClient, headers: dict[str, str]
) -> None:
    for method, path in (
        ("POST", f"{HOME}/constraints/k1/retract"),  # no body, so no preflight
        ("POST", f"{HOME}/robots/a/scans"),
        ("DELETE", HOME),
    ):
        answer = await client.request(method, path, headers=headers)
        expect_problem(answer, 403, "foreign-origin")


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Origin": "http://lineloom", "Sec-Fetch-Site": "same-origin"},
        {"Sec-Fetch-Site": "none"},
    ],
)
async def test_the_services_own_page_does(
    client: httpx.AsyncClient, headers: dict[str, str]
) -> None:
    answer = await client.post(f"{HOME}/constraints/nowhere/retract", headers=headers)
    expect_problem(answer, 404, "unknown-constraint")


async def test_links_have_a_name_of_the_service(client: httpx.AsyncClient) -> None:
    wanted = {"format": "svg"}
    known = await client.post(f"{HOME}/exports", json=wanted)
    assert known.json()["url"].startswith(f"http://lineloom{HOME}/exports/svg-")
    assert known.json()["map"]["mapDownloadLink"] == known.json()["url"]
    got = await client.get(known.json()["url"])
    assert got.headers["cache-control"] == "public, max-age=31536000, immutable"


async def test_sessions_are_no_formulas(client: httpx.AsyncClient) -> None:
    table = (await client.get(f"{HOME}/robots/a/trajectory?format=csv")).text
    rows = list(csv.reader(io.StringIO(table)))
    assert {row[0] for row in rows[1:]} == {"'=1+2", "0"}
    assert not [cell for row in rows for cell in row if cell[:1] in ("=", "+", "@")]


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def guarded(
    tmp_path_factory: pytest.TempPathFactory, make_scan: Make
) -> AsyncIterator[tuple[httpx.AsyncClient, Service]]:
    """A service with sites `s` and `t`, and a client that tells with what token it asks."""
    path: Path = tmp_path_factory.mktemp("guarded")
    settings = Settings(data_dir=path, public_url="https://maps.example/floors")
    engine = LocalEngine(1, publish_every_s=0.05, mapper="fake_mapper:FakeMapper", warm_up=None)
    service = Service(settings, engine=engine)
    await service.start()
    transport = httpx.ASGITransport(create_app(service=service), raise_app_exceptions=False)
    async with httpx.AsyncClient(transport=transport, base_url="http://lineloom") as client:
        for site in ("s", "t"):
            await client.post(f"/v1/sites/{site}/robots/r/scans", json=make_scan(0))
        yield client, service
    await service.stop()


async def _token(service: Service, *scopes: str, site: str | None) -> dict[str, str]:
    token, _ = await service.store.write_apart(create_token, scopes, site=site)
    await service.guard._refresh()
    return {"Authorization": f"Bearer {token}"}


async def test_a_token_of_a_site_is_told_of_that_one_only(
    guarded: tuple[httpx.AsyncClient, Service],
) -> None:
    client, service = guarded
    bound = await _token(service, "read", "operate", site="s")
    sites = (await client.get("/v1/sites", headers=bound)).json()["sites"]
    assert [site["site"] for site in sites] == ["s"]
    for path in ("/v1/sites/s", "/v1/sites/s/map", "/v1/map-formats"):
        assert (await client.get(path, headers=bound)).status_code == 200, path
    for path in ("/v1/sites/t", "/v1/sites/t/map", "/metrics"):
        expect_problem(await client.get(path, headers=bound), 403, "forbidden")
    expect_problem(await client.delete("/v1/sites/t", headers=bound), 403, "forbidden")
    free = await _token(service, "read", site=None)
    sites = (await client.get("/v1/sites", headers=free)).json()["sites"]
    assert [site["site"] for site in sites] == ["s", "t"]


async def test_behind_tokens_exports_are_private_and_names_do_not_matter(
    guarded: tuple[httpx.AsyncClient, Service],
) -> None:
    client, service = guarded
    token = await _token(service, "read", "operate", site=None)
    headers = {**token, "Host": "evil.example", "Origin": "https://evil.example"}
    made = await client.post("/v1/sites/s/exports", json={"format": "svg"}, headers=headers)
    assert made.status_code == 201, made.text
    link = made.json()["url"]
    assert link.startswith("https://maps.example/floors/v1/sites/s/exports/svg-")
    path = link.removeprefix("https://maps.example/floors")
    got = await client.get(path, headers=token)
    assert got.headers["cache-control"] == "private, max-age=31536000, immutable"


async def test_an_unknown_name_is_not_copied_into_links(tmp_path: Path, make_scan: Make) -> None:
    engine = LocalEngine(1, publish_every_s=0.05, mapper="fake_mapper:FakeMapper", warm_up=None)
    service = Service(Settings(data_dir=tmp_path), engine=engine)
    await service.start()
    transport = httpx.ASGITransport(create_app(service=service))
    async with httpx.AsyncClient(transport=transport, base_url="http://10.1.2.3:8765") as client:
        await client.post("/v1/sites/s/robots/r/scans", json=make_scan(0))
        token = await _token(service, "read", "operate", site=None)
        headers = {**token, "Host": "evil.example"}
        made = await client.post("/v1/sites/s/exports", json={"format": "svg"}, headers=headers)
        assert made.json()["url"].startswith("http://10.1.2.3:8765/v1/sites/s/exports/")
        assert made.headers["location"] == made.json()["url"]
    await service.stop()
