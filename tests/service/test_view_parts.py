"""Views travel in parts: whole at the other end, and only what changed is made anew there."""

from __future__ import annotations

import asyncio
import pickle
import zlib
from dataclasses import replace
from itertools import islice

import pytest
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.simulation import Fleet
from lineloom_service.engine import view_parts
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.engine.published import EMPTY_VIEW, Published
from lineloom_service.engine.view_parts import (
    COLLECTIONS,
    ViewDecoder,
    ViewEncoder,
    collections_of,
    without_collections,
)
from lineloom_service.engine.view_record import ViewReader, write_view
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


def _written(view: SiteView) -> dict[str, list[bytes]]:
    """Every part to the last bit; as one piece, pickle would tell shared parts from equal ones."""
    values = {**vars(without_collections(view)), **collections_of(view)}
    return {
        name: [pickle.dumps(part) for part in (value if isinstance(value, tuple) else [value])]
        for name, value in values.items()
    }


def _with_a_wall_moved(view: SiteView) -> SiteView:
    lines = list(view.lines)
    lines[1] = replace(lines[1], x1=99.0)
    return replace(view, lines=tuple(lines))


def _assert_only_the_wall_is_new(first: SiteView, second: SiteView) -> None:
    assert second.lines == _with_a_wall_moved(first).lines
    of_first, of_second = collections_of(first), collections_of(second)
    assert of_first["scans"]
    assert all(
        one is other
        for name in COLLECTIONS
        for one, other in zip(of_first[name], of_second[name], strict=True)
        if other is not second.lines[1]
    )


def _travelled(view: SiteView, encoder: ViewEncoder, decoder: ViewDecoder) -> SiteView:
    return decoder.decode(pickle.loads(pickle.dumps(encoder.encode(view))))


def test_every_view_arrives_whole(views: tuple[SiteView, SiteView]) -> None:
    encoder, decoder = ViewEncoder(), ViewDecoder()
    before, after = views
    assert before.lines
    assert len(after.keyframes) > len(before.keyframes)
    shrunk = replace(after, lines=after.lines[::-2], constraints=())
    for view in (before, after, shrunk, before, after):
        assert _written(_travelled(view, encoder, decoder)) == _written(view)


def test_what_has_not_changed_is_not_sent_again_and_stays_the_same_object(
    views: tuple[SiteView, SiteView],
) -> None:
    encoder, decoder = ViewEncoder(), ViewDecoder()
    first = _travelled(views[0], encoder, decoder)
    parts = encoder.encode(_with_a_wall_moved(views[0]))
    assert len(parts.new) == 1
    second = decoder.decode(parts)
    _assert_only_the_wall_is_new(first, second)


def test_what_is_gone_is_kept_at_neither_end(views: tuple[SiteView, SiteView]) -> None:
    encoder, decoder = ViewEncoder(), ViewDecoder()
    emptied = without_collections(views[0])
    for view in (views[0], emptied):
        _travelled(view, encoder, decoder)
    again = encoder.encode(views[0])
    assert len(again.new) == sum(len(numbers) for numbers in again.numbers.values())
    assert _written(decoder.decode(again)) == _written(views[0])


def test_every_stored_view_is_read_whole(views: tuple[SiteView, SiteView]) -> None:
    reader = ViewReader()
    skip = Skip(7, "r", "scan", "0", 6, "it was cursed")
    before, after = views
    shrunk = replace(after, lines=after.lines[::-2], constraints=())
    for position, view in enumerate((before, after, shrunk, before, EMPTY_VIEW)):
        published = Published(position, 5, 1, view, (skip,))
        read = reader.read(write_view(published))
        assert _written(read.view) == _written(view)
        assert replace(read, view=view) == published


def test_what_a_stored_view_has_of_the_one_before_stays_the_same_object(
    views: tuple[SiteView, SiteView],
) -> None:
    reader = ViewReader()
    first = reader.read(write_view(Published(1, 1, 0, views[0]))).view
    moved = _with_a_wall_moved(views[0])
    second = reader.read(write_view(Published(2, 2, 0, moved))).view
    _assert_only_the_wall_is_new(first, second)
    reader.read(write_view(Published(3, 3, 0, EMPTY_VIEW)))
    assert reader._known == {}


def test_others_get_the_interpreter_between_the_parts_of_a_stored_view(
    views: tuple[SiteView, SiteView], monkeypatch: pytest.MonkeyPatch
) -> None:
    breaths: list[float] = []
    monkeypatch.setattr(view_parts, "_SPELL_S", 0.0)  # as if every part took that long
    monkeypatch.setattr("time.sleep", breaths.append)
    parts = sum(len(own) for own in collections_of(views[0]).values())
    record = write_view(Published(1, 1, 0, views[0]))
    assert len(breaths) == parts > 0
    ViewReader().read(record)
    assert len(breaths) == 2 * parts


def test_a_stored_view_of_other_code_is_told_and_leaves_the_reader_as_it_was(
    views: tuple[SiteView, SiteView],
) -> None:
    reader = ViewReader()
    published = Published(1, 1, 0, views[0])
    first = reader.read(write_view(published)).view
    for data in (b"rubbish", zlib.compress(pickle.dumps(published))):
        with pytest.raises(ValueError, match="unreadable view"):
            reader.read(ViewRecord(2, data))
    again = reader.read(write_view(published)).view
    assert all(one is other for one, other in zip(first.lines, again.lines, strict=True))


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
