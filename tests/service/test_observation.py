"""Histograms add up, latencies are those of the commits, and log lines are what they claim."""

from __future__ import annotations

import contextvars
import json
import logging
from collections.abc import Iterator

import numpy as np
import pytest
from lineloom_service.observation import log
from lineloom_service.observation.durations import BOUNDS, Durations, Histogram
from lineloom_service.observation.latency import Latency
from lineloom_service.store.records import SiteRecord


def test_a_histogram_counts_what_prometheus_means() -> None:
    histogram = Histogram()
    values = [0.0, BOUNDS[0], BOUNDS[0] * 1.01, 0.3, BOUNDS[-1], 1e9]
    for value in values:
        histogram.observe(value)
    for label, count in histogram.buckets():
        bound = float(label)
        assert count == sum(value <= bound * (1 + 1e-9) for value in values), label
    assert histogram.total == sum(values)
    assert histogram.buckets()[-1] == ("+Inf", len(values))


def test_histograms_add_up_in_any_order_and_portion() -> None:
    values = np.random.default_rng(1).lognormal(-4.0, 3.0, 300)
    whole, parts, portion = Durations(), Durations(), Durations()
    for number, value in enumerate(values):
        whole.observe("match", value)
        portion.observe("match", value)
        if number % 7 == 0:
            parts.add(portion.take())
    parts.add(portion.take())
    assert portion.take().stages == {}
    assert parts.stages["match"].counts == whole.stages["match"].counts
    assert parts.stages["match"].total == pytest.approx(whole.stages["match"].total)


def test_latency_is_from_commit_to_map(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    latency = Latency()
    for position in (1, 5, 5, 9):
        latency.on_commit(SiteRecord(7, "s", position, 0, position))
        now += 0.1
    latency.on_view(7, 4, None)  # 1 is in the map
    assert sum(latency.histogram.counts) == 1
    assert latency.histogram.total == pytest.approx(0.4)
    latency.on_view(8, 9, None)  # another site
    now += 1.0
    latency.on_view(7, 9, None)
    assert sum(latency.histogram.counts) == 3
    assert latency.histogram.total == pytest.approx(0.4 + 1.3 + 1.1)


@pytest.fixture
def as_before(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Leaves logging as it was."""
    monkeypatch.setenv("LINELOOM_LOG_FORMAT", "")
    monkeypatch.setenv("LINELOOM_LOG_LEVEL", "")
    root = logging.getLogger()
    handlers, level = list(root.handlers), root.level
    yield
    root.handlers[:], root.level = handlers, level


@pytest.mark.usefixtures("as_before")
def test_a_log_line_is_json_and_says_what_it_is_about(capsys: pytest.CaptureFixture[str]) -> None:
    log.configure("info", "json")

    def work() -> None:
        log.bind(request_id="q1", site="floor", robot=None)
        logger = logging.getLogger("lineloom_service.test")
        logger.info("took %d", 3, extra={"status": 202})
        logger.debug("not shown")
        try:
            raise ValueError("of\ntwo lines")
        except ValueError:
            logger.exception("failed")

    contextvars.Context().run(work)
    first, second = (json.loads(line) for line in capsys.readouterr().err.splitlines())
    assert first.pop("time")
    assert first == {
        "level": "INFO",
        "logger": "lineloom_service.test",
        "message": "took 3",
        "request_id": "q1",
        "site": "floor",
        "status": 202,
    }
    assert "ValueError: of\ntwo lines" in second["exc_info"]


@pytest.mark.usefixtures("as_before")
def test_a_log_line_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    log.configure("info", "text")

    def work() -> None:
        log.bind(site="floor")
        logging.getLogger("lineloom_service.test").warning("took %d", 3)

    contextvars.Context().run(work)
    said = capsys.readouterr().err.strip()
    assert said.endswith("WARNING lineloom_service.test: took 3 (site floor)")
