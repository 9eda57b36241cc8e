"""Progress where nobody has a terminal: merges are told once each, and lines stand for bars."""

from __future__ import annotations

import re

import httpx
import pytest
from lineloom import Client
from lineloom.cli import watch
from lineloom.cli.player import Played
from lineloom.cli.watch import Watch
from lineloom.wire import Component, ScanCounts, Site

from tests.clients.fake_service import FakeService


def site(processed: int, merged: dict[str, str]) -> Site:
    left = {"c1", "c2", "c3"} - set(merged)
    return Site(
        site="s",
        version=processed,
        idle=False,
        scans=ScanCounts(accepted=90, processed=processed, pending=90 - processed),
        robots=["a", "b", "c"],
        components=[Component(id=name, robots=["a", "b"], keyframes=3) for name in sorted(left)],
        merged_into=merged,
        constraints={
            "sequential": {"accepted": 9},
            "rendezvous": {"accepted": 3 - len(left), "rejected": 4},
        },
    )


def test_merges_and_progress_are_told(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    loopback: str,
    fake: FakeService,
) -> None:
    monkeypatch.setattr(watch, "_LINE_S", 0.0)
    before = site(10, {"c9": "c1"}).model_dump()
    fake.routes["GET", "/v1/sites/s"] = lambda request: httpx.Response(200, json=before)
    with Client(loopback) as client, Watch(client, "s", 90) as shown:
        shown.on_site(site(40, {"c9": "c1"}))
        shown.on_site(site(60, {"c9": "c1", "c2": "c1"}))
        shown.on_site(site(70, {"c9": "c1", "c2": "c1"}))
    told = capsys.readouterr().err.splitlines()
    assert [re.sub(r"\d+ scans/s", "N scans/s", line) for line in told] == [
        "sent 0 of 90, mapped 30, N scans/s, 3 components, 0 constraints, 50 pending",
        "component c2 joined c1: a, b (after 50 scans)",
        "sent 0 of 90, mapped 50, N scans/s, 2 components, 1 constraint, 30 pending",
        "sent 0 of 90, mapped 60, N scans/s, 2 components, 1 constraint, 20 pending",
    ]


def test_the_service_is_asked_now_and_then_only(loopback: str, fake: FakeService) -> None:
    with Client(loopback) as client, Watch(client, "s", 90) as shown:
        for sent in range(50):
            # The site is not there yet: that is no reason to stop.
            shown.on_sent(Played(sent=sent))
    assert len(fake.requests) == 2  # at the start, and once on the way
