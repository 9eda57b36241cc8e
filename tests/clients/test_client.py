"""The client against a stand-in for the service: sync and async do the same."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

import httpx
import pytest
from lineloom import (
    AccessDeniedError,
    AsyncClient,
    BusyError,
    Client,
    ConflictError,
    ConnectionFailedError,
    InvalidRequestError,
    NotFoundError,
    NotIdleError,
    RetryPolicy,
    ServiceFailedError,
    UnexpectedAnswerError,
)
from lineloom.wire import MountSettings

from tests.clients.fake_service import FakeService, problem, read_body, scan

URL = "http://lineloom.test"
Run = Callable[..., Any]


def make(fake: FakeService, retry: RetryPolicy, **options: Any) -> Client:
    transport = httpx.MockTransport(fake)
    return Client(URL, retry=retry, transport=transport, **options)


@pytest.fixture(params=["sync", "async"])
def run(request: pytest.FixtureRequest, fake: FakeService, quick: RetryPolicy) -> Run:
    """Call a method of either client: name, arguments, the client's options; keywords."""

    def sync(name: str, args: tuple[Any, ...], options: dict[str, Any], **asked: Any) -> Any:
        with make(fake, quick, **options) as client:
            answer = getattr(client, name)(*args, **asked)
            return list(answer) if isinstance(answer, Iterator) else answer

    def asynchronous(
        name: str, args: tuple[Any, ...], options: dict[str, Any], **asked: Any
    ) -> Any:
        async def go() -> Any:
            transport = httpx.MockTransport(fake.asynchronous)
            async with AsyncClient(URL, retry=quick, transport=transport, **options) as client:
                answer = getattr(client, name)(*args, **asked)
                if isinstance(answer, Awaitable):
                    return await answer
                return [entry async for entry in answer]

        return asyncio.run(go())

    return sync if request.param == "sync" else asynchronous


def site_answer(idle: bool, pending: int = 0) -> httpx.Response:
    body = {"site": "s", "version": 3, "idle": idle, "robots": ["r"], "components": []}
    counts = {"accepted": 9, "processed": 9 - pending, "pending": pending}
    body |= {"scans": counts, "merged_into": {}, "constraints": {}}
    return httpx.Response(200, json=body)


@pytest.mark.parametrize("encoding", ["json", "msgpack"])
@pytest.mark.parametrize("compress", [True, False])
def test_scans_arrive_as_they_were(
    run: Run, fake: FakeService, encoding: str, compress: bool
) -> None:
    scans = [scan(n) | {"ranges": [1.0, None, "inf"] * 60} for n in range(3)]
    answer = run("post_scans", ("s", "r", scans), {"encoding": encoding, "compress": compress})
    assert (answer.accepted, answer.duplicates, answer.rejected) == (3, 0, [])
    (request,) = fake.requests
    assert request.headers["Content-Type"] == f"application/{encoding}"
    assert request.headers.get("Content-Encoding") == ("gzip" if compress else None)
    sent = read_body(request)["scans"]
    assert [entry["stamp"] for entry in sent] == [entry["stamp"] for entry in scans]
    if encoding == "json":
        assert sent[2]["ranges"] == scans[2]["ranges"]


def test_a_long_list_goes_in_batches_and_the_answers_add_up(run: Run, fake: FakeService) -> None:
    fake.unacceptable = {3, 450}
    answer = run("post_scans", ("s", "r", [scan(n) for n in range(500)]), {})
    assert fake.batch_sizes == [200, 200, 100]
    assert (answer.accepted, answer.duplicates, answer.pending) == (498, 0, 498)
    assert [(entry.index, entry.seq) for entry in answer.rejected] == [(3, 3), (450, 450)]
    again = run("post_scans", ("s", "r", [scan(n) for n in range(500)]), {})
    assert (again.accepted, again.duplicates) == (0, 498)


def test_names_are_quoted_and_the_token_is_shown(run: Run, fake: FakeService) -> None:
    with pytest.raises(NotFoundError):
        run("robot", ("a/b", "ä"), {"token": "secret"})
    (request,) = fake.requests
    assert request.url.raw_path == b"/v1/sites/a%2Fb/robots/%C3%A4"
    assert request.headers["Authorization"] == "Bearer secret"


@pytest.mark.parametrize(
    "trouble",
    [
        httpx.ConnectError("refused"),
        httpx.ReadTimeout("timed out"),
        httpx.RemoteProtocolError("broke off"),
        problem(502, "bad-gateway", "proxy"),
        problem(503, "starting", "warming up", Retry_After="0"),
        problem(504, "gateway-timeout", "proxy"),
        problem(429, "backlog", "full", Retry_After="0"),
    ],
)
def test_passing_troubles_are_ridden_out(run: Run, fake: FakeService, trouble: Any) -> None:
    fake.failures = [trouble] * 3
    assert run("post_scan", ("s", "r", scan(0)), {}).accepted == 1
    assert len(fake.requests) == 4


def test_a_lost_answer_does_not_double_the_scan(run: Run, fake: FakeService) -> None:
    fake.lost = 1
    answer = run("post_scan", ("s", "r", scan(0)), {})
    assert (answer.accepted, answer.duplicates) == (0, 1)
    assert len(fake.scans) == 1


def test_it_gives_up_after_the_attempts_allowed(run: Run, fake: FakeService) -> None:
    fake.failures = [httpx.ConnectError("connection refused")] * 9
    with pytest.raises(ConnectionFailedError) as caught:
        run("sites", (), {})
    assert len(fake.requests) == caught.value.attempts == 4
    assert str(caught.value) == f"no answer from {URL}: connection refused (4 attempts)"


def test_a_long_retry_after_is_the_callers_to_decide(run: Run, fake: FakeService) -> None:
    fake.failures = [problem(429, "backlog", "over its limit", Retry_After="3600")]
    with pytest.raises(BusyError) as caught:
        run("post_scan", ("s", "r", scan(0)), {})
    assert caught.value.retry_after == 3600.0
    assert len(fake.requests) == 1


@pytest.mark.parametrize(
    ("status", "kind"),
    [
        (400, InvalidRequestError),
        (401, AccessDeniedError),
        (403, AccessDeniedError),
        (404, NotFoundError),
        (409, ConflictError),
        (413, InvalidRequestError),
        (415, InvalidRequestError),
        (422, InvalidRequestError),
        (500, ServiceFailedError),
    ],
)
def test_problems_keep_their_type_and_are_not_sent_again(
    run: Run, fake: FakeService, status: int, kind: type[Exception]
) -> None:
    body = {"type": "/problems/x", "title": "Wrong", "status": status, "detail": "because"}
    body["errors"] = [{"pointer": "/scans/0/stamp", "reason": "is missing"}]
    fake.failures = [lambda request: httpx.Response(status, content=json.dumps(body))]
    with pytest.raises(kind) as caught:
        run("transform", ("s", "a", "b"), {})
    error: Any = caught.value
    assert (error.type, error.status, error.errors[0].pointer) == (
        "/problems/x",
        status,
        "/scans/0/stamp",
    )
    assert str(error) == f"Wrong ({status}): because; /scans/0/stamp: is missing"
    assert len(fake.requests) == 1


def test_a_strangers_answers_are_told_apart(run: Run, fake: FakeService) -> None:
    fake.failures = [lambda request: httpx.Response(500, text="<html>oops</html>")]
    with pytest.raises(ServiceFailedError, match="oops"):
        run("sites", (), {})
    fake.failures = [lambda request: httpx.Response(200, text="<html>welcome</html>")]
    with pytest.raises(UnexpectedAnswerError, match="SiteList"):
        run("sites", (), {})
    fake.failures = [lambda request: httpx.Response(301, headers={"Location": "https://x/"})]
    with pytest.raises(UnexpectedAnswerError, match="moved to https://x/"):
        run("post_scan", ("s", "r", scan(0)), {})


def test_the_map_of_a_merged_component_is_its_survivors(run: Run, fake: FakeService) -> None:
    there = {"Location": "/v1/sites/s/map?format=svg&component=c1"}
    fake.failures = [lambda request: httpx.Response(307, headers=there)]
    fake.routes["GET", "/v1/sites/s/map"] = lambda request: httpx.Response(
        200, text=request.url.params["component"]
    )
    assert run("map_file", ("s", "svg"), {}) == b"c1"


def test_the_wait_ends_when_the_map_is_done(run: Run, fake: FakeService) -> None:
    answers = [site_answer(False, 5), site_answer(False, 0), site_answer(True)]
    fake.failures = [lambda request, answer=answer: answer for answer in answers]  # type: ignore[misc]
    assert run("wait_until_idle", ("s", 10.0), {}).version == 3
    assert len(fake.requests) == 3


def test_the_wait_says_what_is_missing(run: Run, fake: FakeService) -> None:
    fake.routes["GET", "/v1/sites/s"] = lambda request: site_answer(False, 5)
    with pytest.raises(NotIdleError, match="5 scans are not yet in the map") as caught:
        run("wait_until_idle", ("s", 0.1), {})
    assert caught.value.pending == 5


def test_not_ready_is_an_answer_and_not_an_error(run: Run, fake: FakeService) -> None:
    reasons = {"takes_scans": True, "maps": False, "reasons": ["compiling"]}
    fake.failures = [lambda request: httpx.Response(503, json=reasons)]
    state = run("ready", (), {})
    assert (state.takes_scans, state.maps, state.reasons) == (True, False, ["compiling"])
    assert len(fake.requests) == 1
    fake.routes["GET", "/readyz"] = lambda request: httpx.Response(503, json=reasons)
    run("wait_until_ready", (0.1,), {})
    with pytest.raises(NotIdleError, match="compiling"):
        run("wait_until_ready", (0.1,), {}, maps=True)


def test_constraints_come_page_by_page(run: Run, fake: FakeService) -> None:
    def page(request: httpx.Request) -> httpx.Response:
        cursor = request.url.params.get("cursor")
        entry: dict[str, Any] = {"kind": "loop", "state": "accepted", "id": cursor or "first"}
        entry |= {"keyframe_a": "k-a", "keyframe_b": "k-b", "T_a_b": {"x": 1, "y": 0, "theta": 0}}
        entry |= {"information": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "reason": "consistent"}
        entry |= {"checks": {}, "consistency_set": []}
        following = {None: "second", "second": None}[cursor]
        body = {"site": "s", "version": 1, "constraints": [entry], "next_cursor": following}
        return httpx.Response(200, json=body)

    fake.routes["GET", "/v1/sites/s/constraints"] = page
    found = run("constraints", ("s",), {})
    assert [constraint.id for constraint in found] == ["first", "second"]


def test_matching_sends_both_scans_and_reads_the_verdict(run: Run, fake: FakeService) -> None:
    def answer(request: httpx.Request) -> httpx.Response:
        body = read_body(request)
        assert body["reference"]["ranges"] == [1.0, None, "inf"]
        verdict: dict[str, Any] = {
            "verdict": "weak",
            "T_reference_current": {"x": 0.5, "y": 0, "theta": 0.1},
        }
        verdict |= {"weak_direction": 0.2, "covariance": None, "score": 0.4, "pairs": []}
        verdict |= {"checks": {"conflict": 0.01}, "alternatives": [], "reason": "a corridor"}
        return httpx.Response(200, json=verdict)

    fake.routes["POST", "/v1/match"] = answer
    result = run("match", (scan(0), scan(1)), {})
    assert (result.verdict, result.T_reference_current.x) == ("weak", 0.5)


def test_localizing_sends_a_run_and_reads_the_hypotheses(run: Run, fake: FakeService) -> None:
    def answer(request: httpx.Request) -> httpx.Response:
        assert [s["seq"] for s in read_body(request)["scans"]] == [0, 1]
        best = {"component": "c0", "x": 1.5, "y": 0, "theta": 0.1, "score": 0.97}
        best |= {"covariance": [[0.01, 0, 0], [0, 0.01, 0], [0, 0, None]], "checks": {"margin": 1}}
        found = {"site": "s", "verdict": "unique", "reason": "it fits", "scan": 1}
        return httpx.Response(200, json=found | {"hypotheses": [best]})

    fake.routes["POST", "/v1/sites/s/localize"] = answer
    result = run("localize", ("s", [scan(0), scan(1)]), {})
    assert (result.verdict, result.scan, result.hypotheses[0].x) == ("unique", 1, 1.5)


def test_localizing_takes_one_scan_as_well(run: Run, fake: FakeService) -> None:
    found: dict[str, Any] = {"site": "7", "verdict": "unknown", "reason": "no", "scan": None}
    found["hypotheses"] = []
    fake.routes["POST", "/v1/sites/7/localize"] = lambda _: httpx.Response(200, json=found)
    assert run("localize", (7, scan(3)), {}).verdict == "unknown"
    assert [s["seq"] for s in read_body(fake.requests[-1])["scans"]] == [3]


def test_sites_and_robots_are_deleted(run: Run, fake: FakeService) -> None:
    for path in ("/v1/sites/s", "/v1/sites/s/robots/3"):
        fake.routes["DELETE", path] = lambda _: httpx.Response(204)
    run("delete_robot", ("s", 3), {})
    run("delete_site", ("s",), {})
    assert [request.method for request in fake.requests] == ["DELETE", "DELETE"]


def test_the_mount_is_put(run: Run, fake: FakeService) -> None:
    def answer(request: httpx.Request) -> httpx.Response:
        assert json.loads(request.content)["mount"]["theta"] == 0.5
        counts = {"accepted": 0, "processed": 0, "pending": 0}
        body = {"robot": "r", "site": "s", "state": "starting", "scans": counts, "health": []}
        return httpx.Response(200, json=body)

    fake.routes["PUT", "/v1/sites/s/robots/r"] = answer
    assert run("set_mount", ("s", "r", MountSettings(theta=0.5)), {}).robot == "r"


def test_files_and_texts_come_as_they_are(run: Run, fake: FakeService) -> None:
    def picture(request: httpx.Request) -> httpx.Response:
        assert dict(request.url.params) == {"format": "png"}
        return httpx.Response(200, content=b"\x89PNG")

    fake.routes["GET", "/v1/sites/s/map"] = picture
    assert run("map_file", ("s", "png"), {}) == b"\x89PNG"
    text = "1 0 0 0 0 0 0 1\n"
    tum = "/v1/sites/s/robots/r/trajectory"
    fake.routes["GET", tum] = lambda request: httpx.Response(200, text=text)
    assert run("trajectory_text", ("s", "r"), {}) == text
    fake.routes["GET", "/v1/sites/s/graph"] = lambda request: httpx.Response(200, text="VERTEX")
    assert run("graph_g2o", ("s",), {}) == "VERTEX"


def test_where_a_robot_was_is_told_in_the_floor_plan(run: Run, fake: FakeService) -> None:
    pose = {"session": "0", "seq": 1, "stamp": 2.0, "component": "c0"}
    pose |= {"x": 3.0, "y": 4.0, "theta": 0.5}
    way = {"robot": "r", "version": 3, "poses": [pose]}
    fake.routes["GET", "/v1/sites/s/robots/r/trajectory"] = lambda _: httpx.Response(200, json=way)
    graph = {"graph": {"site": "s", "version": 3}, "nodes": [], "edges": []}
    fake.routes["GET", "/v1/sites/s/graph"] = lambda _: httpx.Response(200, json=graph)
    assert run("trajectory", ("s", "r"), {}, frame="plan").poses[0].x == 3.0
    run("graph", ("s",), {}, align=True)
    assert [dict(r.url.params) for r in fake.requests] == [{"frame": "plan"}, {"align": "true"}]


def test_the_address_comes_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LINELOOM_URL", "http://robots.example:1234/")
    with Client() as client:
        assert client.session.url == "http://robots.example:1234"
        assert client.session.compress
    monkeypatch.delenv("LINELOOM_URL")
    with Client() as client:
        assert client.session.url.startswith("http://127.0.0.1:")
        assert not client.session.compress


@pytest.mark.parametrize("url", ["lineloom.local:80", "ftp://x", "http://", "http://[::1"])
def test_a_wrong_address_is_told_at_once(url: str) -> None:
    with pytest.raises(ConnectionFailedError):
        Client(url)
