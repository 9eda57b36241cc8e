"""The history: facts in chapters on the disk are the same facts as in memory, bit for bit."""

from __future__ import annotations

import gc
import tempfile
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.codec import decode, encode
from lineloom_core.features import ExtractionConfig
from lineloom_core.geometry import Pose
from lineloom_core.mapping.belief.memory import Memory
from lineloom_core.mapping.facts import spool as spool_module
from lineloom_core.mapping.facts.chapter import Chapter
from lineloom_core.mapping.facts.history import History
from lineloom_core.mapping.facts.keyframe import Keyframe, Step
from lineloom_core.mapping.facts.spool import Spool, Spooled
from lineloom_core.places import Recognition, RecognitionConfig
from lineloom_core.scan import Scan

EXTRACTION = ExtractionConfig()
LENGTH = 8


def a_keyframe(number: int, robot: str, session: str, track: int, seq: int) -> Keyframe:
    """Any numbers will do: float32 ones, decimals, none at all, and what is no number."""
    rng = np.random.default_rng(number)
    ranges = rng.uniform(0.1, 8.0, size=number % 5)
    if number % 2:
        ranges = ranges.astype(np.float32).astype(np.float64)
    ranges = np.concatenate([ranges, [np.nan, np.inf, -np.inf, -0.0][: number % 4]])
    scan = Scan(ranges, -1.0, 0.01, 0.1, 8.0, 0.1 * number, seq, session)
    step = None
    if number % 3:
        checks = {"fit": float(rng.uniform())}
        information, drift = rng.normal(size=(2, 3, 3))
        step = Step(number - 1, Pose(0.1, 0.2, 0.3), information, drift, checks)
    pose = Pose.from_array(rng.normal(size=3))
    return Keyframe(number, robot, track, scan, pose, step, 10 * number, EXTRACTION)


def some_keyframes(count: int) -> list[Keyframe]:
    """Of three robots in two sessions each, their scans in no order."""
    rng = np.random.default_rng(5)
    return [
        a_keyframe(k, f"r{k % 3}", str(k // (count // 2)), 2 * (k % 3) + k // (count // 2), seq)
        for k, seq in enumerate(rng.permutation(count).tolist())
    ]


def bits(keyframe: Keyframe) -> tuple[object, ...]:
    """All that a keyframe is."""
    f, step = keyframe, keyframe.step
    scan = (f.scan.ranges.tobytes(), replace(f.scan, ranges=None).__dict__)  # type: ignore[arg-type]
    said = None if step is None else encode(step)
    return f.id, f.robot, f.track, str(scan), f.T_track_laser, said, f.version, f.trusted


def written(keyframes: list[Keyframe]) -> History:
    history, memory = History(LENGTH), Memory(RecognitionConfig())
    for keyframe in keyframes:
        assert history.new_keyframe() == keyframe.id
        history.add(keyframe)
        history.seal(memory.hand_over)
    return history


def all_bits(history: History, begin: int = 0) -> list[tuple[object, ...]]:
    return [bits(f) for f in history.since(begin)]


def reopened(history: History) -> History:
    """As a snapshot does it."""
    other = decode(encode(history), History)
    other.bind(history.chapters(0))
    return other


KEYFRAMES = some_keyframes(44)


def test_a_chapter_comes_back_bit_by_bit() -> None:
    found = Recognition(True, Pose(1.0, 2.0, 0.5), np.eye(3), "why", 3.0, {"fit": 0.5})
    chapter = Chapter.unpack(Chapter(tuple(KEYFRAMES), {(1, 2): found}).pack())
    assert [bits(f) for f in chapter.keyframes] == [bits(f) for f in KEYFRAMES]
    assert chapter.recognitions[1, 2].checks == found.checks
    assert not any(f.scan.ranges.flags.writeable for f in chapter.keyframes)
    assert all(f.scan.ranges.base is None for f in chapter.keyframes)


def test_an_empty_chapter_comes_back() -> None:
    assert Chapter.unpack(Chapter((), {}).pack()).keyframes == ()


@pytest.mark.parametrize("again", [False, True], ids=["as-it-is", "reopened"])
def test_what_is_read_is_what_was_written(again: bool) -> None:
    history = reopened(written(KEYFRAMES)) if again else written(list(KEYFRAMES))
    assert history.sealed == len(KEYFRAMES) // LENGTH
    for begin in range(len(KEYFRAMES) + 1):
        assert all_bits(history, begin) == [bits(f) for f in KEYFRAMES[begin:]]
    assert [bits(history[f.id]) for f in KEYFRAMES] == [bits(f) for f in KEYFRAMES]
    for unknown in (-1, len(KEYFRAMES)):
        with pytest.raises(KeyError):
            history[unknown]


def test_the_nearest_is_that_of_the_slow_twin() -> None:
    history = written(list(KEYFRAMES))
    for seq in range(-1, 50, 3):
        for robot, session in (("r0", "0"), ("r1", "1"), ("r1", "2"), ("r9", "0")):
            own = [f for f in KEYFRAMES if (f.robot, f.scan.session) == (robot, session)]
            twin = min(own, key=lambda f: (abs(f.scan.seq - seq), f.id), default=None)
            found = history.nearest(robot, session, seq)
            assert (found and found.id) == (twin and twin.id)


def test_those_around_are_those_of_the_slow_twin() -> None:
    history = written(list(KEYFRAMES))
    for f in KEYFRAMES:
        chain = [other for other in KEYFRAMES if other.track == f.track]
        at = chain.index(f)
        nearest = sorted(range(len(chain)), key=lambda i: (abs(i - at), i))
        twin = [chain[i].id for i in nearest if abs(i - at) <= 3]
        assert [other.id for other in history.around(f, 3)] == twin


def test_a_keyframe_is_one_object_as_long_as_anybody_holds_it() -> None:
    history = reopened(written(KEYFRAMES))
    held = history[3]
    list(history.since(0))
    assert history[3] is held
    assert next(history.since(3)) is held


def test_memory_holds_the_latest_and_what_others_hold() -> None:
    history = written(some_keyframes(400))
    held = [history[k] for k in (5, 77)]
    list(history.since(0))
    gc.collect()
    assert len(history._held) <= len(held) + 2 * LENGTH + LENGTH


def test_distrust_counts_for_what_is_sealed_and_for_what_is_open() -> None:
    history = written(list(KEYFRAMES))
    before = history[40]
    history.distrust("r1", "1")
    for f in history.since(0):
        assert f.trusted != ((f.robot, f.scan.session) == ("r1", "1"))
    assert before.trusted
    assert not history[40].trusted
    assert all_bits(reopened(history)) == all_bits(history)


def test_the_forgotten_are_gone_and_their_numbers_too() -> None:
    history = written(list(KEYFRAMES))
    history.forget("r2")
    assert {f.robot for f in history.since(0)} == {"r0", "r1"}
    assert history.of("r2") == []
    with pytest.raises(KeyError):
        history[2]
    assert history.new_keyframe() == len(KEYFRAMES)
    back = a_keyframe(len(KEYFRAMES), "r2", "0", 9, 3)
    history.add(back)
    assert history.of("r2") == [back.id]
    assert history.nearest("r2", "0", 0) is back
    assert all_bits(reopened(history)) == all_bits(history)


def test_later_chapters_follow_the_earlier_ones() -> None:
    history = written(KEYFRAMES[:20])
    first = history.chapters(0)
    memory = Memory(RecognitionConfig())
    for f in KEYFRAMES[20:]:
        history.add(f)
        history.seal(memory.hand_over)
    assert history.chapters(0)[: len(first)] == first
    assert history.chapters(2) == history.chapters(0)[2:]


def test_a_spool_gives_back_what_it_took() -> None:
    spool = Spool()
    blocks = [bytes([k]) * (1000 * k) for k in range(20)]
    assert [spool.append(block) for block in blocks] == list(range(20))
    assert [spool[k] for k in (*range(20), 3)] == [*blocks, blocks[3]]
    assert len(spool) == 20
    with pytest.raises(KeyError):
        spool[20]


def test_a_spool_uses_its_room_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spool_module, "_LITTLE", 0)
    rng = np.random.default_rng(2)
    spool, twin = Spool(), dict[int, bytes]()
    for step in range(300):
        block = bytes([step % 256]) * int(rng.integers(1, 500))
        twin[spool.append(block)] = block
        while len(twin) > 10:
            number = int(rng.choice(list(twin)))
            del twin[number]
            spool.discard(number)
        assert {number: spool[number] for number in twin} == twin
        assert spool._file is not None
        assert spool._file.seek(0, 2) <= 2 * sum(map(len, twin.values())) + 500


def test_a_block_goes_with_the_last_who_holds_it() -> None:
    spool = Spool()
    first, second = Spooled(spool, b"first"), Spooled(spool, b"second")
    also = first
    del first
    assert (also.read(), second.read(), len(spool)) == (b"first", b"second", 2)
    del also
    assert len(spool) == 2  # not before the next comes: the collector may come at any time
    third = Spooled(spool, b"third")
    assert (second.read(), third.read(), len(spool)) == (b"second", b"third", 2)


def test_a_full_disk_loses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    spool = Spool()
    spool.append(b"before")
    monkeypatch.setattr(spool._file, "write", full, raising=False)
    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    spool.append(b"while")
    monkeypatch.undo()
    spool.append(b"after")
    assert [spool[k] for k in range(3)] == [b"before", b"while", b"after"]
    spool.discard(1)
    assert [spool[k] for k in (0, 2)] == [b"before", b"after"]
