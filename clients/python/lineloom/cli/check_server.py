"""Whether a service answers, is ready, has the same clock, and what the token may do there."""

from __future__ import annotations

import importlib.metadata
import time
from collections.abc import Iterator
from email.utils import parsedate_to_datetime

import httpx

from lineloom.cli.checkup import Finding, noted, ok, wrong
from lineloom.session import Session

_LATE_S = 5.0
_TIMEOUT_S = 5.0
_NOBODY = "lineloom-doctor"
"""A site and a robot that there are not: what is asked of them changes nothing."""

_PROBES = {
    "read": ("GET", f"/v1/sites/{_NOBODY}", b""),
    # Not JSON: it is refused after the token was looked at, and before anything is taken.
    "ingest": ("POST", f"/v1/sites/{_NOBODY}/robots/{_NOBODY}/scans", b"{"),
    "operate": ("DELETE", f"/v1/sites/{_NOBODY}/exports/{_NOBODY}", b""),
}


def check_server(session: Session) -> Iterator[Finding]:
    """Yield what is found of the service at the session's address."""
    options = session.http_options() | {"timeout": _TIMEOUT_S}
    with httpx.Client(**options) as http:
        try:
            alive = http.get("/healthz")
        except httpx.TransportError as error:
            reason = str(error) or type(error).__name__
            advice = "start one with `lineloom serve`, or name one with --url or LINELOOM_URL"
            yield wrong("server", f"{session.url}: {reason}", advice)
            return
        yield _version(session.url, alive)
        yield _clock(alive)
        yield _ready(http.get("/readyz?maps=true"))
        yield from _scopes(session, http)


def _version(url: str, alive: httpx.Response) -> Finding:
    own = importlib.metadata.version("lineloom-client")
    try:
        version = str(alive.json()["version"])
    except (ValueError, KeyError, TypeError):
        advice = "is this address a Lineloom service, or a proxy before it?"
        return wrong("server", f"{url} answers {alive.status_code}, not as Lineloom does", advice)
    if version != own:
        return noted("server", f"{url} is {version}, the client {own}", "upgrade the older one")
    return ok("server", f"{url} answers, version {version}")


def _clock(alive: httpx.Response) -> Finding:
    told = alive.headers.get("date")
    if told is None:
        return noted("clock", "the server does not tell its time")
    off = time.time() - parsedate_to_datetime(told).timestamp()
    if abs(off) > _LATE_S:
        advice = "no map depends on it, but times in logs will not match: run NTP on both"
        return noted("clock", f"this machine is {off:+.0f} s off the server's", advice)
    return ok("clock", "within seconds of the server's")


def _ready(answer: httpx.Response) -> Finding:
    if answer.status_code == 200:
        return ok("ready", "takes scans and maps them")
    try:
        state = answer.json()
        reasons, takes_scans = "; ".join(state["reasons"]), state["takes_scans"] is True
    except (ValueError, KeyError, TypeError):
        reasons, takes_scans = f"status {answer.status_code}", False
    if takes_scans:
        return noted("ready", f"takes scans, maps none yet: {reasons}", "wait; none is lost")
    return wrong("ready", f"takes no scans: {reasons}", "wait, or look at its log")


def _scopes(session: Session, http: httpx.Client) -> Iterator[Finding]:
    refused: list[str] = []
    allowed: list[str] = []
    for scope, (method, path, body) in _PROBES.items():
        headers = {"Content-Type": "application/json"} if body else {}
        status = http.request(method, path, content=body, headers=headers).status_code
        if status == 401:
            what = "is not known there" if session.token else "is asked for"
            advice = "`lineloom token create` on the server, then --token or LINELOOM_TOKEN"
            yield wrong("token", f"a token {what}", advice)
            return
        (refused if status == 403 else allowed).append(scope)
    may = ", ".join(allowed) or "nothing"
    if not refused:
        how = "the token" if session.token else "without a token, everybody"
        yield ok("token", f"{how} may {may}")
    else:
        bound = " (one bound to a site may still send there)" if "ingest" in refused else ""
        yield noted("token", f"the token may {may}; not {', '.join(refused)}{bound}")
