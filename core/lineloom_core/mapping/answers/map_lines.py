"""The lines of the map: fused over all keyframes, without what later scans look through."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lineloom_core.fusion import FusedLines, LineObservations, fuse
from lineloom_core.fusion.persistence import Stretch, lasting_stretches
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.ray_source import rays_of
from lineloom_core.mapping.answers.site_view import MapLine
from lineloom_core.mapping.belief.site_map import SiteMap

_LINES_PER_KEYFRAME = 100_000
"""Observation ids: keyframe times this plus the line's extraction number; stable for ever."""


def fused_lines(site: SiteMap, component_of: dict[int, str]) -> tuple[MapLine, ...]:
    """Fuse the lines of all keyframes, component by component (design §3 to §8)."""
    members: dict[str, list[int]] = {}
    for keyframe, component in component_of.items():
        members.setdefault(component, []).append(keyframe)
    names = sorted({k.robot for k in site.keyframes.values()})
    lines: list[MapLine] = []
    for component, keyframes in members.items():
        lines.extend(_component_lines(site, component, keyframes, names))
    return tuple(lines)


def _component_lines(
    site: SiteMap, component: str, keyframes: list[int], names: list[str]
) -> Iterator[MapLine]:
    """The lines that last; of one that lasts in parts, each part with those who saw it."""
    observations = _observations(site, keyframes, names)
    if len(observations) == 0:
        return
    fused = fuse(observations, site.config.fusion)
    rays = rays_of(site, sorted(keyframes))
    parts = dict[int, int]()
    for stretch in lasting_stretches(fused.endpoints, rays, site.config.persistence):
        number = parts[stretch.line] = parts.get(stretch.line, -1) + 1
        name = f"l{fused.id[stretch.line]}" + (f".{number}" if number else "")
        if stretch.whole:
            yield _whole_line(fused, stretch.line, name, component, names)
        else:
            yield _part_of_line(fused, observations, stretch, name, component, names)


def _whole_line(fused: FusedLines, i: int, name: str, component: str, names: list[str]) -> MapLine:
    x1, y1, x2, y2 = fused.endpoints[i].tolist()
    return MapLine(
        id=name,
        component=component,
        x1=x1,
        y1=y1,
        x2=x2,
        y2=y2,
        sigma=float(fused.sigma[i]),
        support=int(fused.support[i]),
        robots=tuple(names[r] for r in fused.robots[i]),
        first_seen=float(fused.first_seen[i]),
        last_seen=float(fused.last_seen[i]),
    )


def _part_of_line(
    fused: FusedLines,
    observations: LineObservations,
    stretch: Stretch,
    name: str,
    component: str,
    names: list[str],
) -> MapLine:
    start, end = fused.endpoints[stretch.line, :2], fused.endpoints[stretch.line, 2:]
    along = (end - start) / np.hypot(*(end - start))
    ends = observations.endpoints.reshape(-1, 2, 2)
    from_to = np.sort((ends - start) @ along, axis=1)
    saw = fused.line_of == stretch.line
    saw &= (from_to[:, 0] < stretch.end) & (from_to[:, 1] > stretch.begin)
    if not saw.any():  # between two observations that lie within the fusion's gap
        saw = fused.line_of == stretch.line
    (x1, y1), (x2, y2) = start + stretch.begin * along, start + stretch.end * along
    return MapLine(
        id=name,
        component=component,
        x1=float(x1),
        y1=float(y1),
        x2=float(x2),
        y2=float(y2),
        sigma=float(fused.sigma[stretch.line]),
        support=len(np.unique(observations.keyframe[saw])),
        robots=tuple(names[r] for r in np.unique(observations.robot[saw])),
        first_seen=float(observations.stamp[saw].min()),
        last_seen=float(observations.stamp[saw].max()),
    )


def _observations(site: SiteMap, keyframes: list[int], names: list[str]) -> LineObservations:
    """All keyframes' lines in the component's frame."""
    rows = [(k, site.keyframes[k], site.keyframes[k].segments) for k in keyframes]
    counts = np.array([len(segments) for _, _, segments in rows])
    number = {name: i for i, name in enumerate(names)}
    return LineObservations(
        endpoints=np.concatenate([_moved(site.pose(k), segments) for k, _, segments in rows]),
        sigma=np.concatenate([segments[:, 4] for _, _, segments in rows]),
        weight=np.ones(int(counts.sum())),
        keyframe=np.repeat(np.array([k for k, _, _ in rows], dtype=np.int64), counts),
        robot=np.repeat(np.array([number[f.robot] for _, f, _ in rows], dtype=np.int64), counts),
        stamp=np.repeat(np.array([f.scan.stamp for _, f, _ in rows]), counts),
        id=np.concatenate(
            [
                k * _LINES_PER_KEYFRAME + np.arange(len(segments), dtype=np.int64)
                for k, _, segments in rows
            ]
        ),
    )


def _moved(pose: Pose, segments: NDArray[np.float64]) -> NDArray[np.float64]:
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    x, y = segments[:, 0:4:2], segments[:, 1:4:2]
    moved = np.empty((len(segments), 4))
    moved[:, 0:4:2] = c * x - s * y + pose.x
    moved[:, 1:4:2] = s * x + c * y + pose.y
    return moved
