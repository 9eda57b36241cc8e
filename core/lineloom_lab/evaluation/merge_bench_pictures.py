"""A picture of one robot pair: the truth on the left, the map that came out on the right."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from lineloom_core.io.drawing import INK, MUTED, Drawing, Label, Mark, Strokes, robot_colour, tint
from lineloom_core.io.png import to_png
from lineloom_core.mapping.answers.site_view import SiteView
from numpy.typing import NDArray

from lineloom_lab.evaluation.merge_bench_fleets import BenchFleet
from lineloom_lab.evaluation.merge_bench_overlap import Overlap
from lineloom_lab.evaluation.trajectory import align_rigid

_PANEL_W, _PANEL_H, _MARGIN, _TOP = 760.0, 640.0, 20.0, 70.0
_MOST_REASONS = 6

Place = Callable[[NDArray[np.float64]], tuple[tuple[float, float], ...]]


def draw_pair(
    fleet: BenchFleet, overlap: Overlap, view: SiteView, pair: tuple[str, str], title: str
) -> bytes:
    """Return a PNG of a pair's ways in the truth and in the map, and what was found between them.

    Thick stretches are shared. Where the map joins the two, the truth also shows in grey where it
    puts the second robot's way beside the first one's. Of two components, both are drawn.
    """
    marks: list[Mark] = [Label(_MARGIN, 26.0, f"{title}: {pair[0]} and {pair[1]}", 16.0)]
    marks += _truth(fleet, overlap, pair, _claimed(fleet, view, pair))
    marks += _maps(view, pair)
    lines = _reasons(view, pair)
    marks += [
        Label(_MARGIN, _TOP + _PANEL_H + 20.0 * (k + 1), text, 12.0, MUTED)
        for k, text in enumerate(lines)
    ]
    height = _TOP + _PANEL_H + 20.0 * (len(lines) + 2)
    drawing = Drawing(2 * _PANEL_W + 3 * _MARGIN, height, title, "truth and map", tuple(marks))
    return to_png(drawing)


def _claimed(fleet: BenchFleet, view: SiteView, pair: tuple[str, str]) -> NDArray[np.float64]:
    """The second robot's way, (n, 2) [m], as the map sees it from where the first truly was."""
    first, second = (view.trajectories[robot] for robot in pair)
    common = sorted(set(first.component) & set(second.component))
    if not common:
        return np.empty((0, 2))
    of_first, of_second = (
        np.array([c == common[0] for c in way.component], dtype=bool) for way in (first, second)
    )
    robot = next(r.simulated for r in fleet.robots if r.name == pair[0])
    times = [robot.phase_s + int(seq) / robot.lidar.rate_hz for seq in first.seq[of_first]]
    true = [(robot.drive.pose_at(t) @ robot.mount.T_base_laser).to_array() for t in times]
    T = align_rigid(first.poses[of_first], np.array(true))
    return T.transform(second.poses[of_second][:, :2])


def _truth(
    fleet: BenchFleet, overlap: Overlap, pair: tuple[str, str], claimed: NDArray[np.float64]
) -> list[Mark]:
    """Each robot's floor with its way; the two floors side by side where they differ."""
    ways = fleet.paths()
    index = {r.name: i for i, r in enumerate(fleet.robots)}
    i, j = index[pair[0]], index[pair[1]]
    apart = fleet.robots[i].floor != fleet.robots[j].floor
    marks: list[Mark] = []
    for slot, (own, other) in enumerate(((i, j), (j, i))):
        box = _box(0, slot if apart else 0, 2 if apart else 1)
        walls = fleet.robots[own].simulated.world.walls
        place = _fit(walls.reshape(-1, 2), box)
        marks.append(_segments(walls, place, INK if slot == 0 else MUTED, 1.0))
        if len(claimed) and slot == 0:
            marks.append(Strokes((place(claimed),), MUTED, 3.0, 0.5))
        marks.append(Strokes((place(ways[own]),), robot_colour(slot), 1.5))
        shared = overlap.shared.get((own, other), np.empty((0, 2)))
        for x, y in place(shared) if len(shared) else ():
            marks.append(Strokes((((x - 3.0, y), (x + 3.0, y)),), robot_colour(slot), 4.0, 0.5))
        start = place(ways[own][:1])[0]
        marks.append(Label(*start, fleet.robots[own].name, 12.0, robot_colour(slot), halo=True))
    return marks


def _maps(view: SiteView, pair: tuple[str, str]) -> list[Mark]:
    """The components in which the two robots are, with their ways."""
    found = dict.fromkeys(c for robot in pair for c in view.trajectories[robot].component)
    components = [c for c in found if any(line.component == c for line in view.lines)][:4]
    marks: list[Mark] = []
    for slot, component in enumerate(components):
        lines = np.array([(w.x1, w.y1, w.x2, w.y2) for w in view.lines if w.component == component])
        place = _fit(lines.reshape(-1, 2), _box(1, slot, len(components)))
        marks.append(_segments(lines, place, INK, 1.0))
        for k, robot in enumerate(pair):
            way = view.trajectories[robot]
            here = np.array([c == component for c in way.component], dtype=bool)
            if here.any():
                marks.append(Strokes((place(way.poses[here][:, :2]),), robot_colour(k), 1.5))
        box = _box(1, slot, len(components))
        marks.append(Label(box[0], box[1] + 12.0, component, 12.0, MUTED))
    return marks


def _reasons(view: SiteView, pair: tuple[str, str]) -> list[str]:
    """The constraints between the two, counted by state and reason."""
    robot_of = {k.id: k.robot for k in view.keyframes}
    counts: dict[str, int] = {}
    for c in view.constraints:
        ends = sorted((robot_of[c.keyframe_a], robot_of[c.keyframe_b]))
        if c.kind != "sequential" and ends == list(pair):
            text = f"{c.kind} {c.state}: {c.reason}"
            counts[text] = counts.get(text, 0) + 1
    ranked = sorted(counts.items(), key=lambda item: -item[1])[:_MOST_REASONS]
    return [f"{n} x {text}" for text, n in ranked] or ["nothing was found between the two"]


def _box(column: int, slot: int, slots: int) -> tuple[float, float, float, float]:
    """Left, top, width and height of a panel [px]."""
    height = _PANEL_H / slots
    return _MARGIN + column * (_PANEL_W + _MARGIN), _TOP + slot * height, _PANEL_W, height - 12.0


def _fit(points: NDArray[np.float64], box: tuple[float, float, float, float]) -> Place:
    """Return what brings points [m] into a box [px], y upwards."""
    low, high = points.min(axis=0), points.max(axis=0)
    scale = min(box[2] / max(high[0] - low[0], 1.0), box[3] / max(high[1] - low[1], 1.0))

    def place(rows: NDArray[np.float64]) -> tuple[tuple[float, float], ...]:
        x = box[0] + scale * (rows[:, 0] - low[0])
        y = box[1] + scale * (high[1] - rows[:, 1])
        return tuple(zip(x.tolist(), y.tolist(), strict=True))

    return place


def _segments(rows: NDArray[np.float64], place: Place, colour: str, width: float) -> Mark:
    ends: Sequence[tuple[float, float]] = place(rows.reshape(-1, 2))
    lines = tuple((ends[2 * k], ends[2 * k + 1]) for k in range(len(rows)))
    return Strokes(lines, tint(colour, 0.7), width)
