"""Views travel as changes: whole at the other end, and only what changed is made anew there."""

from __future__ import annotations

import asyncio
import pickle
import sys
import zlib
from collections.abc import Callable
from dataclasses import replace
from itertools import islice, pairwise

import pytest
from lineloom_core.codec import encode
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.answers.view_change import EMPTY_VIEW, ViewChange
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.simulation import Fleet
from lineloom_service.engine import view_parts, view_record
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.engine.published import Published
from lineloom_service.engine.view_parts import ViewDecoder, ViewEncoder, read_change, write_change
from lineloom_service.engine.view_record import ViewReader, ViewWriter
from lineloom_service.store.records import Skip, ViewRecord


@pytest.fixture(scope="module")
def views() -> tuple[SiteView, SiteView]:
    """A site, and the same as the robot has driven on through it."""
    mapper = SiteMapper()
    scans = Fleet.office(seed=4, robots=1).scans()
    for seen in islice(scans, 120):
        mapper.add("r", seen.scan)
    before = mapper.view()
    for seen in islice(scans, 60):
        mapper.add("r", seen.scan)
    return before, mapper.view()


def _same(one: SiteView, other: SiteView) -> bool:
    """Whether two views say the same to the last bit."""
    return one.version == other.version and not ViewChange.between(one, other)


def _with_a_wall_moved(view: SiteView) -> SiteView:
    lines = list(view.lines)
    lines[1] = replace(lines[1], x1=99.0)
    return replace(view, lines=tuple(lines))


def _assert_only_the_wall_is_new(first: SiteView, second: SiteView) -> None:
    assert second.lines == _with_a_wall_moved(first).lines
    assert [a is b for a, b in zip(first.lines, second.lines, strict=True)].count(False) == 1
    assert second.trajectories is first.trajectories
    assert second.keyframes is first.keyframes
    assert second.constraints is first.constraints


def test_every_view_arrives_whole(views: tuple[SiteView, SiteView]) -> None:
    encoder, decoder = ViewEncoder(), ViewDecoder()
    before, after = views
    assert before.lines
    assert len(after.keyframes) > len(before.keyframes)
    shrunk = replace(after, lines=after.lines[::-2], constraints=())
    for view in (before, after, shrunk, before, EMPTY_VIEW, after):
        assert _same(decoder.decode(encoder.encode(view)), view)


def test_what_has_not_changed_is_not_sent_again_and_stays_the_same_object(
    views: tuple[SiteView, SiteView],
) -> None:
    encoder, decoder = ViewEncoder(), ViewDecoder()
    first = decoder.decode(encoder.encode(views[0]))
    parts = encoder.encode(_with_a_wall_moved(views[0]))
    change = read_change(parts)
    assert [name for name, table in change.tables().items() if table] == ["lines"]
    assert list(change.lines.new) == [views[0].lines[1].id]
    _assert_only_the_wall_is_new(first, decoder.decode(parts))


def test_a_view_that_cannot_be_written_is_not_taken_for_sent(
    views: tuple[SiteView, SiteView],
) -> None:
    encoder, decoder = ViewEncoder(), ViewDecoder()
    unwritable = replace(views[0], merged_into={"c1": object()})  # type: ignore[dict-item]
    with pytest.raises((ValueError, TypeError)):
        encoder.encode(unwritable)
    assert _same(decoder.decode(encoder.encode(views[0])), views[0])


def test_every_stored_view_is_read_whole(views: tuple[SiteView, SiteView]) -> None:
    writer, reader = ViewWriter(), ViewReader()
    skip = Skip(7, "r", "scan", "0", 6, "it was cursed")
    before, after = views
    shrunk = replace(after, lines=after.lines[::-2], constraints=())
    for position, view in enumerate((before, after, shrunk, before, EMPTY_VIEW)):
        published = Published(position, 5, 1, view, (skip,))
        record = writer.write(published)
        for read in (reader.read(record), ViewReader().read(record)):
            assert _same(read.view, view)
            assert replace(read, view=view) == published


def test_a_record_grows_by_what_changed_until_the_whole_is_as_small(
    views: tuple[SiteView, SiteView],
) -> None:
    writer, reader = ViewWriter(), ViewReader()
    view, sizes = views[0], list[int]()
    for position in range(200):
        view = replace(view, version=position, lines=(*view.lines[1:], view.lines[0]))
        record = writer.write(Published(position, 0, 0, view))
        assert _same(reader.read(record).view, view)
        sizes.append(len(record.data))
    shrinkings = [a for a, b in pairwise(sizes) if b < a]
    assert len(shrinkings) > 1
    assert max(sizes) <= 2 * sizes[0] + 100


def test_what_a_stored_view_has_of_the_one_before_stays_the_same_object(
    views: tuple[SiteView, SiteView],
) -> None:
    writer, reader = ViewWriter(), ViewReader()
    first = reader.read(writer.write(Published(1, 1, 0, views[0]))).view
    moved = Published(2, 2, 0, _with_a_wall_moved(views[0]))
    second = reader.read(writer.write(moved)).view
    _assert_only_the_wall_is_new(first, second)
    # From another process that has taken over, too.
    third = reader.read(ViewWriter().write(replace(moved, position=3))).view
    assert third.lines is second.lines
    assert third.trajectories is second.trajectories


def test_others_get_the_interpreter_between_the_parts_of_a_stored_view(
    views: tuple[SiteView, SiteView], monkeypatch: pytest.MonkeyPatch
) -> None:
    breaths: list[float] = []
    monkeypatch.setattr(view_parts, "_SPELL_S", 0.0)  # as if every part took that long
    monkeypatch.setattr("time.sleep", breaths.append)
    parts = len(list(write_change(ViewChange.between(EMPTY_VIEW, views[0]))))
    assert parts > 5
    record = ViewWriter().write(Published(1, 1, 0, views[0]))
    written = len(breaths)
    assert written >= parts
    ViewReader().read(record)
    assert len(breaths) - written == parts - 1


class _Trap:
    """Runs code when it is unpickled."""

    def __reduce__(self) -> tuple[Callable[..., object], tuple[str]]:
        return exec, ("import sys; sys.trapped = True",)


def _frame(*parts: bytes) -> bytes:
    step = zlib.compress(encode(parts))
    return len(step).to_bytes(4, "little") + step


def test_a_stored_view_that_is_damaged_or_hostile_is_told_and_leaves_the_reader_as_it_was(
    views: tuple[SiteView, SiteView], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(view_record, "_MOST_BYTES", 1 << 20)
    reader, published = ViewReader(), Published(1, 1, 0, views[0])
    record = ViewWriter().write(published)
    first = reader.read(record)
    head = encode((2, 2, 0, ()))
    good = tuple(write_change(ViewChange.between(EMPTY_VIEW, views[0])))
    bare = good[-1]
    hostile = [
        b"rubbish",
        pickle.dumps(_Trap()),
        zlib.compress(pickle.dumps(_Trap())),
        _frame(pickle.dumps(_Trap()), bare),
        _frame(head, pickle.dumps(_Trap()), bare),
        _frame(head),
        _frame(),
        _frame(bare, head),
        _frame(head, encode(("lines", {"l1": 1})), bare),
        _frame(head, encode(("lines", {k.id: k for k in views[0].keyframes})), bare),
        _frame(head, encode(("walls", {})), bare),
        _frame(head, *[part for part in good if b"scans" not in part]),
        _frame(head, encode(7)),
        _frame(head, bytes(1 << 20)),
        b"",
        _frame(encode((3, 2, 0, ())), *good),
        record.data + b"rubbish",
        *(record.data[:cut] for cut in range(1, len(record.data), 997)),
        *(_flipped(record.data, at) for at in range(0, len(record.data), 997)),
    ]
    for data in hostile:
        with pytest.raises(ValueError, match="unreadable view"):
            reader.read(ViewRecord(2, data))
    assert not hasattr(sys, "trapped")
    again = reader.read(record)
    assert again == first
    assert again.view.lines is first.view.lines


def _flipped(data: bytes, at: int) -> bytes:
    return data[:at] + bytes((data[at] ^ 0x10,)) + data[at + 1 :]


async def test_of_a_site_that_is_stopped_nothing_is_kept() -> None:
    engine = LocalEngine(1, mapper="fake_mapper:FakeMapper", warm_up=None)
    seen = asyncio.Event()
    engine.subscribe(lambda *_: seen.set())
    await engine.start()
    try:
        await engine.start_site(7, 0, None)
        await seen.wait()
        (process,) = [slot.process for slot in engine._slots]
        assert process is not None
        assert list(process._decoders) == [7]
        engine.stop_site(7)
        async with asyncio.timeout(60.0):
            while process._decoders:
                await asyncio.sleep(0.01)
    finally:
        await engine.stop()
