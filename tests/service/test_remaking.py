"""Other parameters make a site's map anew, beside the one that is shown."""

from __future__ import annotations

import asyncio
import json
import time
from pathlib import Path
from typing import Any

import pytest
from lineloom import Client
from lineloom_core.mapping.config import MapperConfig, config_from
from lineloom_service.engine.published import Published
from lineloom_service.events.codec import unpack
from lineloom_service.site_config import ordered
from lineloom_service.store.actions import append_scans, configure, delete_site, forget_robot
from lineloom_service.store.config_entry import ConfigEntry
from lineloom_service.store.files import read_file
from lineloom_service.store.reads import read_events, read_feed

from tests.service.fake_server import free_port, server
from tests.service.system import System, fingerprint, running

SLOW = {"FAKE_MAPPER_SECONDS": "0.005"}


def _sets_of(count: int) -> ConfigEntry:
    return ordered({"join": {"least_set": count}}, MapperConfig())


def _least_set(published: Published) -> int:
    """The parameter that the fake mapper shows with every robot."""
    pose = published.view.robots["r"].pose
    assert pose is not None
    return round(pose.y + 2.0)


async def _configure(system: System, count: int) -> ConfigEntry:
    found = await system.store.write(configure, "site", _sets_of(count), make=True)
    assert found is not None
    return found


async def _remade(system: System, count: int) -> Published:
    return await system.until(lambda p: "r" in p.view.robots and _least_set(p) == count)


async def _events(system: System) -> list[tuple[str, dict[str, Any]]]:
    """All that was told of the site, oldest first."""
    record = await system.store.site("site")
    assert record is not None
    batches = await system.store.read(read_events, record.id, 0, 10_000)
    return [(told.type, json.loads(told.data)) for b in batches for told in unpack(b.body)]


@pytest.fixture
async def reference(tmp_path: Path) -> tuple[int, tuple[str, ...]]:
    """The map of 60 scans, an order of sets of 5 after the 40th, made in one go."""
    async with running(tmp_path / "reference", None) as system:
        await system.post(range(40))
        await _configure(system, 5)
        await system.post(range(40, 60))
        await _remade(system, 5)
        return fingerprint((await system.caught_up()).view)


async def test_it_is_as_if_it_had_been_made_so_from_the_first_scan(
    tmp_path: Path, reference: tuple[int, tuple[str, ...]]
) -> None:
    async with running(tmp_path, None) as system:
        await _configure(system, 4)
        await system.post(range(40))
        await _configure(system, 5)
        await system.post(range(40, 60))
        await _remade(system, 5)
        again = fingerprint((await system.caught_up()).view)
    assert again[1] == reference[1], "the same lines"
    assert again[0] == reference[0] + 1, "one entry more in the log"


async def test_what_is_shown_goes_on_meanwhile_and_is_then_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_MAPPER_SECONDS", SLOW["FAKE_MAPPER_SECONDS"])
    async with running(tmp_path, None, records=True) as system:
        await system.post(range(100))
        before = await system.caught_up()
        site = await system.store.site("site")
        assert site is not None
        await _configure(system, 5)
        await system.post(range(100, 120))
        grown = await system.until(lambda p: p.scans >= 104)
        assert _least_set(grown) == 2, "the map before, with what came since"
        assert grown.view.version > before.view.version
        remaking = system.conductor.remaking(site.id)
        assert remaking is not None
        assert (remaking.why, remaking.of) == ("other parameters", 121)
        assert system.conductor.not_ready() == []
        assert await system.conductor.ask(site.id, "explain", "k0-1") is not None

        remade = await _remade(system, 5)
        assert system.conductor.remaking(site.id) is None
        assert (remade.view.version, remade.scans) == (121, 120)
        assert await system.conductor.ask(site.id, "explain", "k0-1") is not None
        await system.post(range(120, 125))
        assert _least_set(await system.until(lambda p: p.scans == 125)) == 5


async def test_a_version_never_names_two_maps(tmp_path: Path) -> None:
    shown: dict[int, tuple[str, ...]] = {}
    async with running(tmp_path, None) as system:

        def look(_site: int, _position: int, _view: object) -> None:
            version, lines = fingerprint(system.conductor.published(1).view)
            assert shown.setdefault(version, lines) == lines

        system.conductor.subscribe(look)
        for count, begin in ((2, 0), (4, 20), (2, 40), (5, 60)):
            await _configure(system, count)
            await system.post(range(begin, begin + 20))
            await _remade(system, count)
            await system.caught_up()
    assert list(shown) == sorted(shown)
    assert len(shown) > 4


async def test_the_difference_is_told_and_kept(tmp_path: Path) -> None:
    async with running(tmp_path, None, records=True) as system:
        await system.post(range(30))
        await system.caught_up()
        await _configure(system, 5)
        await _remade(system, 5)
        site = await system.store.site("site")
        assert site is not None
        told: dict[str, dict[str, Any]] = {}
        while "remade" not in told:
            await asyncio.sleep(0.01)
            told = dict((await _events(system))[-2:])
        kept = await system.store.read(read_file, site.id, "remade", "last")
        assert kept is not None
    assert list(told) == ["remade", "reset"]
    remade = told["remade"]
    assert json.loads(kept.about) == remade
    assert (remade["version_before"], remade["version"]) == (30, 31)
    assert remade["why"] == "other parameters"
    moved = remade["robots"]
    assert moved == [
        {
            "robot": "r",
            "component_before": "c1",
            "component_after": "c1",
            "moved_m": 3.0,
            "turned_rad": 0.0,
        }
    ]
    assert (remade["lines_changed"], remade["lines_removed"]) == (3, 3)


async def test_a_second_order_meanwhile_begins_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_MAPPER_SECONDS", SLOW["FAKE_MAPPER_SECONDS"])
    seen: set[int] = set()
    async with running(tmp_path, None) as system:
        await system.post(range(80))
        await system.caught_up()
        await _configure(system, 4)
        await asyncio.sleep(0.1)
        await _configure(system, 5)
        while 5 not in seen:
            seen.add(_least_set(await system.published()))
            await asyncio.sleep(0.005)
    assert seen == {2, 5}


async def test_back_to_what_it_was_is_shown_as_well(tmp_path: Path) -> None:
    async with running(tmp_path, None) as system:
        await system.post(range(20))
        first = fingerprint((await system.caught_up()).view)
        await _configure(system, 5)
        await _remade(system, 5)
        await _configure(system, 2)
        await _remade(system, 2)
        last = fingerprint((await system.caught_up()).view)
    assert last == (first[0] + 2, first[1])


async def test_what_operators_do_meanwhile_is_in_both(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_MAPPER_SECONDS", SLOW["FAKE_MAPPER_SECONDS"])
    async with running(tmp_path, None) as system:
        await system.post(range(80))
        other = await system.store.write(append_scans, "site", "s", [], processed=0, limit=10**9)
        await system.caught_up()
        await _configure(system, 5)
        assert await system.store.write(forget_robot, "site", "s")
        forgotten = await system.until(lambda p: p.position >= other.position + 2)
        assert _least_set(forgotten) == 2
        remade = await _remade(system, 5)
    assert remade.view.version == 82
    assert list(remade.view.robots) == ["r"]


async def test_a_site_that_is_deleted_meanwhile_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_MAPPER_SECONDS", SLOW["FAKE_MAPPER_SECONDS"])
    async with running(tmp_path, None, records=True) as system:
        await system.post(range(60))
        await system.caught_up()
        await _configure(system, 5)
        await asyncio.sleep(0.1)
        site = await system.store.write(delete_site, "site")
        assert site is not None
        await system.conductor.forget_site(site)
        assert system.conductor.remaking(site) is None
        for _ in range(6000):
            if not system.engine._sites:
                break
            await asyncio.sleep(0.01)
        assert system.engine._sites == {}, "neither of the two"
        await system.post(range(3))
        assert (await system.until(lambda p: p.scans == 3)).view.version == 3


@pytest.mark.parametrize("saved", [True, False], ids=["saved", "never-saved"])
async def test_a_stop_meanwhile_loses_neither(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, saved: bool
) -> None:
    changes = {"snapshot_every": 20 if saved else 10_000, "stop_grace_s": 0.0}
    async with running(tmp_path, None, records=True, **changes) as system:
        await system.post(range(100))
        await system.caught_up()
        monkeypatch.setenv("FAKE_MAPPER_SECONDS", SLOW["FAKE_MAPPER_SECONDS"])
        await _configure(system, 5)
        system.engine._slots[0].process.kill()  # type: ignore[union-attr]
        await asyncio.sleep(0.3)
    async with running(tmp_path, None, records=True, **changes) as system:
        first = await system.until(lambda p: "r" in p.view.robots)
        assert _least_set(first) == (2 if saved else 5)
        assert (first.scans >= 80) == saved
        remade = await _remade(system, 5)
        whole = await system.caught_up()
    assert remade.view.version <= whole.view.version == 101


async def test_parameters_before_the_first_scan_hold_at_once(tmp_path: Path) -> None:
    async with running(tmp_path, None) as system:
        await _configure(system, 4)
        await _configure(system, 5)
        assert system.conductor.remaking(1) is None
        await system.post(range(5))
        found = await system.until(lambda p: p.scans == 5)
    assert (_least_set(found), found.view.version) == (5, 7)


async def test_the_service_s_file_holds_where_a_site_names_nothing(tmp_path: Path) -> None:
    file = tmp_path / "mapper.toml"
    file.write_text("[join]\nleast_set = 6\n", encoding="utf-8")
    async with running(tmp_path, None, records=True) as system:
        await system.post(range(20))
        assert _least_set(await system.caught_up()) == 2
    async with running(tmp_path, None, records=True, mapper_config=file) as system:
        assert _least_set(await _remade(system, 6)) == 6
        entries = await system.store.read(read_feed, 1, 0, 100)
        assert [e.kind for e in entries] == ["scan"] * 20 + ["config"]
        body = ConfigEntry.decode(entries[-1].body or b"")
        assert config_from(body.parameters).join.least_set == 6
        assert body.own == {}
    async with running(tmp_path, None, records=True, mapper_config=file) as system:
        assert _least_set(await system.caught_up()) == 6
        assert len(await system.store.read(read_feed, 1, 0, 100)) == 21, "nothing new is logged"
        await system.store.write(append_scans, "new", "r", [], processed=0, limit=10**9)
        new = await system.store.site("new")
        assert new is not None
        assert new.config is not None
        assert (new.config.digest, new.config.position) == (body.digest, 1)
    async with running(tmp_path, None, records=True) as system:
        assert _least_set(await _remade(system, 2)) == 2


def _other_code(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("site_config", "engine.making"):
        monkeypatch.setattr(
            f"lineloom_service.{module}.digest", lambda config: f"other.{config.join.least_set}"
        )


async def test_other_code_makes_it_anew_beside_the_view_that_was_saved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running(tmp_path, None, records=True) as system:
        await system.post(range(40))
        await system.caught_up()
    _other_code(monkeypatch)
    monkeypatch.setenv("FAKE_MAPPER_SECONDS", "0.02")
    async with running(tmp_path, None, records=True) as system:
        shown = await system.until(lambda p: p.position > 0)
        assert (shown.position, shown.view.version) == (40, 40)
        remaking = system.conductor.remaking(1)
        assert remaking is not None
        assert "code" in remaking.why
        assert not [reason for reason in system.conductor.not_ready() if "site" in reason]
        remade = await system.until(lambda p: p.view.version > 40)
        assert (remade.position, remade.view.version) == (41, 41)
        assert remade.view.lines == shown.view.lines, "the fake mapper's code is the same"
    async with running(tmp_path, None, records=True) as system:
        assert (await system.caught_up()).view.version == 41
        assert system.conductor.remaking(1) is None
        assert len(await system.store.read(read_feed, 1, 0, 100)) == 41, "and logged once"


def test_a_kill_meanwhile_loses_neither(tmp_path: Path) -> None:
    port = free_port()
    scans = [
        {
            "seq": n,
            "stamp": float(n),
            "angle_min": -1.0,
            "angle_increment": 0.5,
            "range_min": 0.1,
            "range_max": 30.0,
            "ranges": [1.0, 2.0, 3.0, 4.0, 5.0],
        }
        for n in range(230)
    ]
    with Client(f"http://127.0.0.1:{port}") as client:
        with server(tmp_path, port):
            client.post_scans("s", "r", scans[:210])
            before = client.wait_until_idle("s")
            time.sleep(1.0)  # a snapshot is taken every 100 entries
        with server(tmp_path, port, **SLOW) as process:
            client.wait_until_idle("s")
            assert "made anew" in (client.set_config("s", {"join": {"least_set": 5}}).effect or "")
            while (made := client.site("s").remaking) is None or made.position < 60:
                time.sleep(0.02)
            process.kill()
            process.wait()
        with server(tmp_path, port, FAKE_MAPPER_SECONDS="0.02"):
            while (between := client.site("s")).version < before.version:
                time.sleep(0.02)
            assert between.version == before.version, "as before the kill"
            assert between.remaking is not None
            client.post_scans("s", "r", scans[210:])
            while client.site("s").remaking is not None:
                time.sleep(0.05)
            after = client.wait_until_idle("s")
            pose = client.robot("s", "r").pose
    assert (after.version, after.scans.processed) == (231, 230)
    assert pose is not None
    assert pose.y == 3.0
