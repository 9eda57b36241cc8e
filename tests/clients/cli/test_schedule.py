"""One log as several robots: cut by time, numbered anew, played together."""

from __future__ import annotations

import pytest
from lineloom.cli.schedule import Stream, robot_name, split, together
from lineloom.scan_like import to_wire

from tests.clients.fake_service import scan


def stream(stamps: list[float], robot: str = "r") -> Stream:
    return Stream(robot, [to_wire(scan(n, stamp=stamp)) for n, stamp in enumerate(stamps)])


def test_parts_are_consecutive_and_of_equal_time() -> None:
    # Twice as many scans in the second half: the cut is by time, not by count.
    stamps = [float(n) for n in range(6)] + [6.0 + 0.5 * n for n in range(13)]
    parts = split(stream(stamps), 3)
    assert [part.robot for part in parts] == ["r-1", "r-2", "r-3"]
    assert [[entry.stamp for entry in part.scans] for part in parts] == [
        [0.0, 1.0, 2.0, 3.0],
        [4.0, 5.0, 6.0, 6.5, 7.0, 7.5],
        [8.0, 8.5, 9.0, 9.5, 10.0, 10.5, 11.0, 11.5, 12.0],
    ]
    assert [entry.seq for entry in parts[1].scans] == list(range(6))
    assert {entry.session for entry in parts[1].scans} == {"0.2of3"}


def test_a_stamp_that_steps_back_stays_in_its_part() -> None:
    parts = split(stream([0.0, 4.0, 6.0, 3.0, 7.0, 10.0]), 2)
    assert [[entry.stamp for entry in part.scans] for part in parts] == [
        [0.0, 4.0],
        [6.0, 3.0, 7.0, 10.0],
    ]


def test_every_scan_is_in_exactly_one_part() -> None:
    whole = stream([0.37 * n for n in range(100)])
    for count in (1, 2, 3, 7, 100):
        parts = split(whole, count)
        stamps = [entry.stamp for part in parts for entry in part.scans]
        assert stamps == [entry.stamp for entry in whole.scans]


def test_a_log_without_time_is_one_part() -> None:
    parts = split(stream([5.0, 5.0, 5.0]), 2)
    assert [len(part.scans) for part in parts] == [3]
    assert parts[0].duration == 0.0


def test_streams_set_out_together_and_keep_their_order() -> None:
    a, b = stream([100.0, 101.0, 100.5, 103.0], "a"), stream([7.0, 7.9, 9.5], "b")
    played = list(together([a, b]))
    assert [(due.robot, due.scan.stamp) for due in played] == [
        ("a", 100.0),
        ("b", 7.0),
        ("b", 7.9),
        ("a", 101.0),
        ("a", 100.5),
        ("b", 9.5),
        ("a", 103.0),
    ]
    assert [due.at for due in played] == sorted(due.at for due in played)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("mit-csail", "mit-csail"),
        ("Lauf 3 (Süd)", "Lauf-3-S-d"),
        ("..hidden", "hidden"),
        ("x" * 90, "x" * 64),
        ("ö", "robot"),
    ],
)
def test_names_are_made_as_the_contract_allows(text: str, name: str) -> None:
    assert robot_name(text) == name
