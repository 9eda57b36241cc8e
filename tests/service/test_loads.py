"""When a site is sent too much, and what its robots are told then."""

from __future__ import annotations

from dataclasses import dataclass, field

from lineloom_service.observation.loads import Load, Loads
from lineloom_service.store.records import RobotRecord, SiteRecord

SITE = 7


@dataclass
class Drive:
    """Robots that send so many scans a second, to a mapper that maps so many."""

    sent_hz: int
    mapped_hz: int
    robots: int = 4
    now: float = 100.0
    sent: int = 0
    mapped: int = 0
    loads: Loads = field(init=False)

    def __post_init__(self) -> None:
        self.loads = Loads(lambda _: self.mapped, lambda: self.now)

    def record(self, *, deleted: bool = False) -> SiteRecord:
        own = self.sent // self.robots
        robots = {f"r{k}": RobotRecord(f"r{k}", own, 0, None, 0) for k in range(self.robots)}
        return SiteRecord(
            id=SITE, name="s", position=self.sent, held=0, accepted=self.sent, robots=robots,
            config=None, deleted=deleted, late=0, order=0,
        )  # fmt: skip

    def go_on(self, seconds: int) -> Load:
        for _ in range(seconds):
            self.now += 1.0
            self.sent += self.sent_hz
            self.mapped = min(self.mapped + self.mapped_hz, self.sent)
            self.loads.on_commit(self.record())
        return self.loads.of(self.record())


def test_what_is_kept_up_with_is_no_load() -> None:
    assert Drive(sent_hz=80, mapped_hz=100).go_on(60) == Load()


def test_what_grows_is_told_with_what_each_robot_may_send() -> None:
    drive = Drive(sent_hz=120, mapped_hz=40)
    assert drive.go_on(2) == Load()
    assert drive.go_on(20) == Load(True, 10.0)


def test_a_site_that_recovers_says_so() -> None:
    drive = Drive(sent_hz=120, mapped_hz=40)
    drive.go_on(20)
    drive.sent_hz = 20
    assert drive.go_on(10).is_over
    assert drive.go_on(100) == Load()


def test_a_robot_that_is_gone_does_not_count() -> None:
    drive = Drive(sent_hz=120, mapped_hz=40)
    drive.go_on(10)
    drive.robots = 2
    assert drive.go_on(30) == Load(True, 20.0)


def test_a_site_that_nobody_sends_to_or_that_is_deleted_has_none() -> None:
    drive = Drive(sent_hz=120, mapped_hz=40)
    assert drive.loads.of(drive.record()) == Load()
    drive.go_on(20)
    drive.loads.on_commit(drive.record(deleted=True))
    assert drive.loads.of(drive.record()) == Load()
