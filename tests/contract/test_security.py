"""Tokens, scopes, and what protects browsers, on a service that has tokens."""

from __future__ import annotations

import gzip
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx
import msgpack
import pytest
import pytest_asyncio
from fastapi.routing import APIRoute
from lineloom_service.app import create_app
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.routes import OPEN_ROUTERS, ROUTERS
from lineloom_service.security.scopes import scope_of
from lineloom_service.security.token_book import create_token, revoke_token
from lineloom_service.service import Service
from lineloom_service.settings import Settings
from lineloom_service.store.maintenance import run_beside

from tests.contract.posting import JSON, MSGPACK, expect_problem

pytestmark = pytest.mark.asyncio(loop_scope="module")

Ask = Callable[..., Any]


class Keys:
    """Tokens of every kind, by name."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.ids: dict[str, str] = {}
        self.tokens: dict[str, str] = {}
        for name, scopes, bound in (
            ("read", ["read"], {}),
            ("operate", ["operate"], {}),
            ("all", ["read", "operate", "ingest"], {}),
            ("ingest", ["ingest"], {}),
            ("at-s", ["ingest"], {"site": "s"}),
            ("r-at-s", ["ingest"], {"site": "s", "robot": "r"}),
        ):
            self.make(name, scopes, **bound)

    def make(self, name: str, scopes: list[str], **bound: str) -> None:
        token, record = run_beside(self._settings, lambda c: create_token(c, scopes, **bound))
        self.tokens[name], self.ids[name] = token, record.id

    def revoke(self, name: str) -> None:
        assert run_beside(self._settings, lambda c: revoke_token(c, self.ids[name]))
        assert not run_beside(self._settings, lambda c: revoke_token(c, self.ids[name]))

    def header(self, name: str) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.tokens[name]}"}


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def service(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Service]:
    settings = Settings(
        data_dir=tmp_path_factory.mktemp("data"),
        allow_origins=("https://viewer.example",),
        host="0.0.0.0",
        open=True,
    )
    engine = LocalEngine(1, publish_every_s=0.05, mapper="fake_mapper:FakeMapper", warm_up=None)
    service = Service(settings, engine=engine)
    await service.start()
    yield service
    await service.stop()


@pytest.fixture(scope="module")
def keys(service: Service) -> Keys:
    # Made while the service runs on the same data.
    return Keys(service.settings)


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def client(service: Service, keys: Keys) -> AsyncIterator[httpx.AsyncClient]:
    await service.guard._refresh()
    transport = httpx.ASGITransport(create_app(service=service), raise_app_exceptions=False)
    async with httpx.AsyncClient(transport=transport, base_url="http://lineloom") as client:
        yield client


async def test_without_a_token_nothing_is_told(client: httpx.AsyncClient) -> None:
    for headers in (
        {},
        {"Authorization": "Basic dTpw"},
        {"Authorization": "Bearer"},
        {"Authorization": "Bearer nonsense"},
        {"Authorization": f"Bearer lineloom_{'0' * 12}_{'a' * 43}"},
    ):
        response = await client.get("/v1/sites", headers=headers)
        expect_problem(response, 401, "unauthorized")
        assert response.headers["www-authenticate"].startswith("Bearer")
    # Neither whether a site exists, nor what is wrong with a body.
    expect_problem(await client.get("/v1/sites/none"), 401, "unauthorized")
    expect_problem(await client.post("/v1/match", content=b"x"), 401, "unauthorized")


async def test_a_token_in_the_address_is_none(client: httpx.AsyncClient, keys: Keys) -> None:
    for name in ("token", "access_token", "authorization"):
        params = {name: keys.tokens["all"]}
        expect_problem(await client.get("/v1/sites", params=params), 401, "unauthorized")


async def test_a_wrong_secret_to_a_right_id(client: httpx.AsyncClient, keys: Keys) -> None:
    token = keys.tokens["all"]
    for wrong in (token[:-1] + ("A" if token[-1] != "A" else "B"), token + "A", token[:-1]):
        response = await client.get("/v1/sites", headers={"Authorization": f"Bearer {wrong}"})
        expect_problem(response, 401, "unauthorized")


async def test_what_is_open_says_nothing(client: httpx.AsyncClient) -> None:
    for path in ("/healthz", "/docs", "/docs/start.js", "/openapi.json"):
        assert (await client.get(path)).status_code == 200, path
    assert (await client.get("/readyz")).status_code in (200, 503)


ROUTES = [
    (method, route.path)
    for router in ROUTERS
    for route in router.routes
    if isinstance(route, APIRoute)
    for method in route.methods or ()
]


def _path(template: str) -> str:
    for name in ("site", "robot", "robot_a", "robot_b", "constraint"):
        template = template.replace("{" + name + "}", "x")
    return template


@pytest.mark.parametrize(("method", "path"), ROUTES)
async def test_every_route_takes_its_scope_and_no_other(
    client: httpx.AsyncClient, keys: Keys, method: str, path: str
) -> None:
    needed = scope_of(method, path)
    for name in ("read", "operate", "ingest"):
        # No body: whoever may pass is refused for that, and nothing is changed.
        response = await client.request(method, _path(path), headers=keys.header(name))
        if name == needed:
            assert response.status_code not in (401, 403), (name, response.text)
        else:
            expect_problem(response, 403, "forbidden")
            assert f'scope="{needed}"' in response.headers["www-authenticate"]
    expect_problem(await client.request(method, _path(path)), 401, "unauthorized")


async def test_scopes_are_as_documented() -> None:
    assert {path for method, path in ROUTES if scope_of(method, path) == "ingest"} == {
        "/v1/sites/{site}/robots/{robot}/scans",
        "/v1/sites/{site}/robots/{robot}",
    }
    for method, path in ROUTES:
        if method == "GET":
            assert scope_of(method, path) == "read"
        if method == "DELETE":
            assert scope_of(method, path) == "operate"
    assert scope_of("POST", "/v1/something/new") == "operate"


async def test_only_what_is_meant_to_be_is_open() -> None:
    paths = {
        route.path
        for router in OPEN_ROUTERS
        for route in router.routes
        if isinstance(route, APIRoute)
    }
    assert all(not path.startswith("/v1") for path in paths)


async def test_an_ingest_token_may_be_bound(
    client: httpx.AsyncClient, keys: Keys, make_scan: Ask
) -> None:
    async def post(name: str, site: str, robot: str) -> httpx.Response:
        url = f"/v1/sites/{site}/robots/{robot}/scans"
        return await client.post(url, json=make_scan(0), headers=keys.header(name))

    for name, site, robot, allowed in (
        ("ingest", "any", "any", True),
        ("at-s", "s", "q", True),
        ("at-s", "t", "q", False),
        ("r-at-s", "s", "r", True),
        ("r-at-s", "s", "q", False),
        ("r-at-s", "t", "r", False),
    ):
        response = await post(name, site, robot)
        if allowed:
            assert response.status_code == 202, response.text
        else:
            expect_problem(response, 403, "forbidden")
    sites = (await client.get("/v1/sites", headers=keys.header("read"))).json()["sites"]
    assert {site["site"] for site in sites} == {"any", "s"}


async def test_new_and_revoked_tokens_count_at_once(
    client: httpx.AsyncClient, service: Service, keys: Keys
) -> None:
    service.guard._read_at -= 1.0
    keys.make("late", ["read"])
    assert (await client.get("/v1/sites", headers=keys.header("late"))).status_code == 200
    keys.revoke("late")
    await service.guard._refresh()
    expect_problem(await client.get("/v1/sites", headers=keys.header("late")), 401, "unauthorized")
    assert not service.guard.still_good(keys.ids["late"])
    assert service.guard.still_good(keys.ids["read"])


async def test_secrets_are_nowhere_on_the_disk(service: Service, keys: Keys) -> None:
    content = b"".join(
        path.read_bytes() for path in Path(service.settings.data_dir).iterdir() if path.is_file()
    )
    assert keys.ids["all"].encode() in content
    for token in keys.tokens.values():
        assert token.split("_", 2)[2].encode() not in content


async def test_pages_run_no_foreign_script(client: httpx.AsyncClient) -> None:
    page = await client.get("/docs")
    policy = page.headers["content-security-policy"]
    assert "script-src 'self';" in policy
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy
    assert "//" not in page.text.replace("<!doctype", "")
    assert "<script>" not in page.text
    for response in (page, await client.get("/v1/sites")):
        assert response.headers["x-content-type-options"] == "nosniff"
        assert response.headers["x-frame-options"] == "DENY"
        assert response.headers["referrer-policy"] == "no-referrer"
    for name in ("swagger-ui.css", "swagger-ui-bundle.js"):
        assert (await client.get(f"/docs/files/{name}")).status_code == 200


async def test_other_origins_only_where_allowed(client: httpx.AsyncClient, keys: Keys) -> None:
    headers = keys.header("read")
    for origin, allowed in (("https://viewer.example", True), ("https://evil.example", False)):
        response = await client.get("/v1/sites", headers={**headers, "Origin": origin})
        assert (response.headers.get("access-control-allow-origin") == origin) is allowed
        asked = {"Access-Control-Request-Method": "GET", "Origin": origin}
        response = await client.options(
            "/v1/sites", headers={**asked, "Access-Control-Request-Headers": "authorization"}
        )
        assert (response.status_code == 200) is allowed
        assert "access-control-allow-credentials" not in response.headers


async def test_no_other_origin_by_default(tmp_path: Path) -> None:
    service = Service(Settings(data_dir=tmp_path))
    async with httpx.AsyncClient(
        transport=httpx.ASGITransport(create_app(service=service)), base_url="http://lineloom"
    ) as client:
        response = await client.get("/healthz", headers={"Origin": "https://viewer.example"})
        assert not [name for name in response.headers if name.startswith("access-control")]


BOMBS = {
    "one large member": gzip.compress(b" " * (64 * 1024 * 1024), 9),
    "many members": gzip.compress(b"") * 100_000,
    "many members that add up": gzip.compress(b" " * 1024 * 1024, 9) * 60,
}


@pytest.mark.parametrize("bomb", BOMBS.values(), ids=BOMBS.keys())
async def test_gzip_bombs(client: httpx.AsyncClient, keys: Keys, bomb: bytes) -> None:
    headers = {**JSON, **keys.header("ingest"), "Content-Encoding": "gzip"}
    response = await client.post("/v1/sites/s/robots/r/scans", content=bomb, headers=headers)
    expect_problem(response, 413, "too-large")


@pytest.mark.parametrize("encoding", ["gzip, gzip", "deflate", "br", "gzip;q=1", "x" * 1000])
async def test_encodings_of_encodings(client: httpx.AsyncClient, keys: Keys, encoding: str) -> None:
    bomb = gzip.compress(gzip.compress(b" " * (64 * 1024 * 1024)))
    headers = {**JSON, **keys.header("ingest"), "Content-Encoding": encoding}
    response = await client.post("/v1/sites/s/robots/r/scans", content=bomb, headers=headers)
    expect_problem(response, 415, "unsupported-content-encoding")


@pytest.mark.parametrize(
    "body",
    [
        # Headers of arrays and maps that announce far more than there is, one in the other.
        b"\xdd\x00\xff\xff\xff" * 400,
        b"\xdf\x00\xff\xff\xff" * 400,
        b"\x91" * 100_000,
        msgpack.packb({"scans": [{"ranges": [[[]]] * 1000}]}),
        b"\xc7\xff\x01" + b"x" * 255,
    ],
)
async def test_msgpack_bombs(client: httpx.AsyncClient, keys: Keys, body: bytes) -> None:
    headers = {**MSGPACK, **keys.header("ingest")}
    response = await client.post("/v1/sites/s/robots/r/scans", content=body, headers=headers)
    assert response.status_code in (400, 422), response.text


async def test_json_that_nests_without_end(client: httpx.AsyncClient, keys: Keys) -> None:
    headers = {**JSON, **keys.header("ingest")}
    for body in (b"[" * 100_000, b'{"scans":' * 100_000, b'{"seq": ' + b"9" * 100_000 + b"}"):
        response = await client.post("/v1/sites/s/robots/r/scans", content=body, headers=headers)
        assert response.status_code in (400, 422), response.text


@pytest.mark.parametrize(
    "name", ["..", "%2e%2e", "a%2Fb", "%00", "a%00b", "-a", ".a", "a b", "a" * 65, "%C3%A4", "a%0A"]
)
async def test_names_that_are_none(client: httpx.AsyncClient, keys: Keys, name: str) -> None:
    for path in (f"/v1/sites/{name}", f"/v1/sites/s/robots/{name}/trajectory"):
        response = await client.get(path, headers=keys.header("read"))
        assert response.status_code in (404, 422), response.text
        assert "Traceback" not in response.text
    url = f"/v1/sites/s/robots/{name}/scans"
    response = await client.post(url, json={}, headers=keys.header("ingest"))
    assert response.status_code in (404, 422)
