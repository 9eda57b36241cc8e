"""The figures of `GET /metrics`."""

from __future__ import annotations

import time
from collections import Counter as Tally
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from lineloom.wire import Readiness
from lineloom_core.mapping.answers.site_view import SiteView
from prometheus_client import CollectorRegistry, Counter, Gauge, Info
from prometheus_client import Histogram as PrometheusHistogram
from prometheus_client.core import GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.registry import Collector

from lineloom_service import __version__
from lineloom_service.observation.durations import Durations, Histogram

_MOST_SILENT = 50
_HTTP_BOUNDS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True, slots=True)
class SiteFigures:
    """A site now. pending: log entries not yet in the published map. remaking: not yet in the
    one that is made to be shown instead. troubled: `trouble` says something. silent: robots that
    send nothing, and for how long [s]."""

    name: str
    pending: int
    held: int
    view: SiteView
    remaking: int = 0
    troubled: bool = False
    silent: Mapping[str, float] = field(default_factory=dict)


class Metrics:
    """All figures, in a registry of their own: two services in one process do not mix them up."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        accepted = Counter(
            "lineloom_scans_accepted", "Scans on disk, by site.", ["site"], registry=self.registry
        )
        duplicate = Counter(
            "lineloom_scans_duplicate",
            "Scans that were there already, by site.",
            ["site"],
            registry=self.registry,
        )
        self._scans = {"accepted": accepted, "duplicate": duplicate}
        self._refused = Counter(
            "lineloom_scans_refused",
            "Scans of a batch that were refused, by what is wrong with which field.",
            ["reason"],
            registry=self.registry,
        )
        self._problems = Counter(
            "lineloom_requests_refused",
            "Requests answered by a problem, by its type.",
            ["reason"],
            registry=self.registry,
        )
        self._requests = PrometheusHistogram(
            "lineloom_http_request_seconds",
            "Time to answer, streams of events aside.",
            ["method", "route", "status"],
            buckets=_HTTP_BOUNDS,
            registry=self.registry,
        )
        self.listeners = Gauge(
            "lineloom_event_streams", "Listeners to events.", registry=self.registry
        )
        started = Gauge(
            "lineloom_start_time_seconds", "When the service started.", registry=self.registry
        )
        started.set(time.time())
        Info("lineloom_build", "The code.", registry=self.registry).info({"version": __version__})

    def count_scans(self, site: str, accepted: int, duplicate: int) -> None:
        """Count what became of the scans of a POST."""
        self._scans["accepted"].labels(site).inc(accepted)
        self._scans["duplicate"].labels(site).inc(duplicate)

    def count_refused_scan(self, field: str) -> None:
        """Count a scan that was refused for one of its fields."""
        self._refused.labels(field).inc()

    def count_problem(self, slug: str) -> None:
        """Count a request that was answered by a problem."""
        self._problems.labels(slug).inc()

    def observe_request(self, method: str, route: str, status: int, seconds: float) -> None:
        """Count an answer."""
        self._requests.labels(method, route, status).observe(seconds)

    def watch(
        self,
        sites: Callable[[], Sequence[SiteFigures]],
        durations: Callable[[], Durations],
        latency: Histogram,
        readiness: Callable[[], Readiness],
    ) -> None:
        """Have figures of the state looked up whenever somebody asks for the metrics."""
        self.registry.register(_State(sites, durations, latency, readiness))


class _State(Collector):
    """What is there now, as opposed to what has happened."""

    def __init__(
        self,
        sites: Callable[[], Sequence[SiteFigures]],
        durations: Callable[[], Durations],
        latency: Histogram,
        readiness: Callable[[], Readiness],
    ) -> None:
        self._sites = sites
        self._durations = durations
        self._latency = latency
        self._readiness = readiness

    def describe(self) -> list[GaugeMetricFamily]:
        """Say nothing while being registered: nothing has started yet."""
        return []

    def collect(self) -> Iterator[GaugeMetricFamily | HistogramMetricFamily]:
        """Yield every family."""
        state = self._readiness()
        yield GaugeMetricFamily(
            "lineloom_takes_scans", "1 where /readyz says yes.", value=float(state.takes_scans)
        )
        yield GaugeMetricFamily(
            "lineloom_ready",
            "1 where /readyz?maps=true says yes.",
            value=float(state.takes_scans and state.maps),
        )
        yield from _site_gauges(self._sites())
        yield HistogramMetricFamily(
            "lineloom_processing_latency_seconds",
            "From accepted (202) to in the published map, a sample for every commit.",
            buckets=self._latency.buckets(),
            sum_value=self._latency.total,
        )
        family = HistogramMetricFamily(
            "lineloom_mapper_seconds",
            "Time of the mapper's stages: entry (a log entry in all), track, match (places with "
            "each other), optimise (the pose graph), view, snapshot.",
            labels=["stage"],
        )
        for stage, histogram in sorted(self._durations().stages.items()):
            family.add_metric([stage], histogram.buckets(), histogram.total)
        yield family


def _site_gauges(sites: Sequence[SiteFigures]) -> Iterator[GaugeMetricFamily]:
    figures: list[tuple[str, str, Callable[[SiteFigures], float]]] = [
        ("backlog_entries", "Log entries not yet in the published map.", lambda s: s.pending),
        ("held_scans", "Scans that wait for those before them.", lambda s: s.held),
        (
            "remaking_entries",
            "Log entries not yet in the map that is made anew; 0 where none is.",
            lambda s: s.remaking,
        ),
        ("trouble", "1 where `trouble` of the site says what is wrong.", lambda s: s.troubled),
        ("version", "Version of the published map.", lambda s: s.view.version),
        ("components", "Components.", lambda s: len(s.view.components)),
        ("keyframes", "Keyframes.", lambda s: len(s.view.keyframes)),
        ("map_lines", "Lines of the map.", lambda s: len(s.view.lines)),
    ]
    for name, text, read in figures:
        family = GaugeMetricFamily(f"lineloom_{name}", text, labels=["site"])
        for site in sites:
            family.add_metric([site.name], read(site))
        yield family
    robots = GaugeMetricFamily("lineloom_robots", "Robots by state.", labels=["site", "state"])
    constraints = GaugeMetricFamily(
        "lineloom_constraints", "Constraints by state.", labels=["site", "kind", "state"]
    )
    for site in sites:
        states = Tally(
            "silent" if name in site.silent else robot.state
            for name, robot in site.view.robots.items()
        )
        for state, count in states.items():
            robots.add_metric([site.name, state], count)
        for kind, count in Tally((c.kind, c.state) for c in site.view.constraints).items():
            constraints.add_metric([site.name, *kind], count)
    yield robots
    yield constraints
    yield from _robot_gauges(sites)


def _robot_gauges(sites: Sequence[SiteFigures]) -> Iterator[GaugeMetricFamily]:
    """What is the matter with robots; of the silent ones those that are so for longest."""
    findings = GaugeMetricFamily(
        "lineloom_findings",
        "Robots by what their health names.",
        labels=["site", "finding"],
    )
    silent = GaugeMetricFamily(
        "lineloom_robot_silent_seconds",
        "Since a silent robot's last scan, or since the start; the 50 longest of a site.",
        labels=["site", "robot"],
    )
    for site in sites:
        said = (text for robot in site.view.robots.values() for text in robot.health)
        names = Tally(text.partition(": ")[0] for text in said)
        names.update({"silent": len(site.silent)} if site.silent else {})
        for name, count in names.items():
            findings.add_metric([site.name, name], count)
        longest = sorted(site.silent.items(), key=lambda row: -row[1])[:_MOST_SILENT]
        for robot, seconds in longest:
            silent.add_metric([site.name, robot], seconds)
    yield findings
    yield silent
