"""The order in which scans are fed: laws first, then the cases that led to them."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st
from lineloom_service.store.sequencer import Sequencer, Stream

WINDOW = 2.0


def _arrive(order: Sequencer, session: str, seq: int, now: float, entry: int | None = None) -> None:
    stream = order.streams.setdefault(session, Stream(len(order.streams) + 1, session))
    late = order.is_late(stream, seq)
    stream.hold(seq, seq if entry is None else entry, now, late=late)


def _sequencer(max_held: int = 1000) -> Sequencer:
    return Sequencer(WINDOW, max_held)


@settings(max_examples=200, deadline=None)
@given(order=st.permutations(list(range(12))), pauses=st.lists(st.floats(0, 0.1), min_size=12))
def test_within_the_window_any_order_of_arrival_gives_the_order_of_seq(
    order: list[int], pauses: list[float]
) -> None:
    sequencer, now, released = _sequencer(), 0.0, []
    for seq, pause in zip(order, pauses, strict=False):
        now += pause
        _arrive(sequencer, "0", seq, now)
        released += sequencer.release(now)
    assert released == list(range(12))
    assert sequencer.held == 0


@settings(max_examples=200, deadline=None)
@given(
    arrivals=st.lists(
        st.tuples(st.sampled_from("abc"), st.integers(0, 30), st.floats(0, 3)), max_size=40
    )
)
def test_every_scan_goes_out_exactly_once_and_none_waits_beyond_the_window(
    arrivals: list[tuple[str, int, float]],
) -> None:
    sequencer, now, released, due = _sequencer(), 0.0, [], {}
    taken: set[tuple[str, int]] = set()
    names: dict[int, tuple[str, int]] = {}
    for entry, (session, seq, pause) in enumerate(arrivals):
        now += pause
        if (session, seq) in taken:
            continue
        taken.add((session, seq))
        names[entry] = (session, seq)
        _arrive(sequencer, session, seq, now, entry)
        due[entry] = now + WINDOW
        released += sequencer.release(now)
        late = {e for stream in sequencer.streams.values() for e in stream.late.values()}
        assert all(e in released for e, limit in due.items() if limit <= now and e not in late)
    while (deadline := sequencer.next_deadline()) is not None:
        released += sequencer.release(deadline + 1e-9)
    sent = [names[entry] for entry in released]
    assert all(a[1] < b[1] for a, b in pairwise(sent) if a[0] == b[0]), "never backwards"
    released += [e for _, late in sequencer.pop_late() for _, e in late]
    assert sorted(released) == sorted(due)
    assert sequencer.accepted == len(due)


def test_steps_of_two_cost_one_window_each_and_do_not_add_up() -> None:
    sequencer = _sequencer()
    delays = []
    pending: dict[int, float] = {}
    now = 0.0
    for tick in range(400):
        now = tick * 0.05
        if tick < 200:
            _arrive(sequencer, "0", 2 * tick, now)
            pending[2 * tick] = now
        delays += [now - pending.pop(seq) for seq in sequencer.release(now)]
    assert not pending
    assert max(delays) <= WINDOW + 0.051


def test_a_late_scan_waits_for_its_place() -> None:
    sequencer = _sequencer()
    for seq in (0, 1, 5):
        _arrive(sequencer, "0", seq, 0.0)
    assert sequencer.release(0.0) == [0, 1]
    assert sequencer.release(WINDOW) == [5]
    _arrive(sequencer, "0", 3, 3.0)
    assert sequencer.release(3.0) == []
    assert (sequencer.held, sequencer.late) == (0, 1)
    assert sequencer.next_deadline() is None
    _arrive(sequencer, "0", 6, 3.0)
    assert sequencer.release(3.0) == [6]
    assert [late for _, late in sequencer.pop_late()] == [[(3, 3)]]
    assert sequencer.late == 0


def test_what_an_older_session_has_left_is_late() -> None:
    sequencer = _sequencer()
    _arrive(sequencer, "old", 0, 0.0, 100)
    _arrive(sequencer, "new", 0, 0.0, 200)
    assert sequencer.release(0.0) == [100, 200]
    _arrive(sequencer, "old", 1, 0.1, 101)
    assert sequencer.release(WINDOW) == []
    assert sequencer.late == 1


def test_a_younger_session_waits_for_the_older_ones_gap() -> None:
    sequencer = _sequencer()
    _arrive(sequencer, "old", 0, 0.0, 100)
    _arrive(sequencer, "old", 2, 0.0, 102)
    assert sequencer.release(0.0) == [100]
    _arrive(sequencer, "new", 0, 0.5, 200)
    assert sequencer.release(0.5) == []
    _arrive(sequencer, "old", 1, 0.6, 101)
    assert sequencer.release(0.6) == [101, 102, 200]


def test_the_older_sessions_gap_does_not_hold_a_younger_one_beyond_the_window() -> None:
    sequencer = _sequencer()
    _arrive(sequencer, "old", 5, 0.0, 105)
    _arrive(sequencer, "new", 0, 0.5, 200)
    assert sequencer.release(0.5) == []
    assert sequencer.release(WINDOW) == [105, 200]


def test_too_many_held_scans_push_the_lowest_out() -> None:
    sequencer = _sequencer(max_held=10)
    for seq in range(100, 130, 2):
        _arrive(sequencer, "0", seq, 0.0)
    assert sequencer.release(0.0) == [100, 102, 104, 106, 108]
    assert sequencer.held == 10


def test_flush_releases_all_in_order() -> None:
    sequencer = _sequencer()
    for seq in (9, 4, 7):
        _arrive(sequencer, "0", seq, 0.0)
    assert sequencer.flush() == [4, 7, 9]
    assert sequencer.next_deadline() is None
