"""The lines of the map: walls of all keyframes, without what later scans look through."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features._kernels import VAR_OFFSET
from lineloom_core.fusion import LineObservations
from lineloom_core.fusion.corners import close_corners
from lineloom_core.fusion.layers import layers_of
from lineloom_core.fusion.persistence import lasting_stretches
from lineloom_core.fusion.stretches import Stretches
from lineloom_core.fusion.walls import Surfaces, find_walls
from lineloom_core.mapping.answers.ray_source import rays_of
from lineloom_core.mapping.answers.seen_surfaces import Seen, seen_by
from lineloom_core.mapping.answers.site_view import MapLine
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.facts.keyframe import Keyframe

_LINES_PER_KEYFRAME = 100_000
"""Observation ids: keyframe times this plus the line's extraction number; stable for ever."""


def fused_lines(site: SiteMap, component_of: dict[int, str]) -> tuple[MapLine, ...]:
    """Fuse the lines of all keyframes, component by component (design §3 to §8)."""
    members: dict[str, list[int]] = {}
    for keyframe, component in component_of.items():
        members.setdefault(component, []).append(keyframe)
    lines: list[MapLine] = []
    for component, keyframes in members.items():
        lines.extend(_component_lines(site, component, sorted(keyframes)))
    return tuple(lines)


def _component_lines(site: SiteMap, component: str, keyframes: list[int]) -> Iterator[MapLine]:
    """The walls that last, with their corners closed; those that one keyframe saw as they are."""
    frames = [site.keyframes[k] for k in keyframes]
    poses = np.array([site.pose(k).to_array() for k in keyframes]).reshape(-1, 3)
    seen = [seen_by(frame) for frame in frames]
    observations = _observations(frames, seen, poses)
    if len(observations) == 0:
        return
    walls = find_walls(observations, _surfaces(seen, poses), site.config.fusion)
    rays, config = rays_of(site, keyframes), site.config.persistence
    lasting = lasting_stretches(walls.endpoints, rays, config)
    if not lasting:
        return
    of = np.array([s.line for s in lasting], dtype=np.int64)
    begin, end = np.array([s.begin for s in lasting]), np.array([s.end for s in lasting])
    ends, once = _cut(walls.endpoints[of], begin, end), walls.once[of]
    met = np.zeros((len(of), 2), dtype=np.bool_)
    ends[~once], met[~once] = close_corners(ends[~once], rays, config)
    layers, names = layers_of(ends, walls.wall[of], once, met), _names(walls, of)
    stamps = np.array([f.scan.stamp for f in frames])
    robots, robot = np.unique([f.robot for f in frames], return_inverse=True)
    for k, saw in enumerate(walls.seen_by(of, begin, end)):
        if len(saw) < site.config.fusion.min_support:
            continue
        x1, y1, x2, y2 = ends[k].tolist()
        yield MapLine(
            id=names[k],
            component=component,
            x1=x1,
            y1=y1,
            x2=x2,
            y2=y2,
            sigma=float(walls.sigma[of[k]]),
            support=len(saw),
            robots=tuple(robots[np.unique(robot[saw])].tolist()),
            first_seen=float(stamps[saw].min()),
            last_seen=float(stamps[saw].max()),
            layer=layers[k],
            wall=f"w{walls.wall_id[of[k]]}",
        )


def _names(walls: Stretches, of: NDArray[np.int64]) -> list[str]:
    """Name what is left of stretches: parts of one, and those that have no name, by number."""
    names: list[str] = []
    parts: dict[str, int] = {}
    for i in of.tolist():
        name = f"l{walls.id[i]}" if walls.id[i] >= 0 else f"w{walls.wall_id[i]}"
        number = parts[name] = parts.get(name, -1) + 1
        names.append(f"{name}.{number}" if number or walls.id[i] < 0 else name)
    return names


def _cut(
    lines: NDArray[np.float64], begin: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return what is left of each line, (m, 4)."""
    along = lines[:, 2:] - lines[:, :2]
    along = along / np.hypot(along[:, 0], along[:, 1])[:, None]
    start = lines[:, :2]
    return np.hstack([start + begin[:, None] * along, start + end[:, None] * along])


def _surfaces(seen: Sequence[Seen], poses: NDArray[np.float64]) -> Surfaces:
    return Surfaces(
        poses=poses,
        begins=np.cumsum([0, *(len(s.points) for s in seen)]),
        points=np.concatenate([s.points for s in seen]),
        normals=np.concatenate([s.normals for s in seen]),
        beams=np.concatenate([s.beams for s in seen], dtype=np.int64),
    )


def _observations(
    frames: Sequence[Keyframe], seen: Sequence[Seen], poses: NDArray[np.float64]
) -> LineObservations:
    """All keyframes' lines in the component's frame."""
    lines, counts = np.concatenate([s.lines for s in seen]), [len(s.lines) for s in seen]
    of = np.repeat(np.arange(len(frames)), counts)
    keyframe = np.array([f.id for f in frames], dtype=np.int64)[of]
    c, s = np.cos(poses[of, 2, None]), np.sin(poses[of, 2, None])
    x, y = lines[:, 0:4:2], lines[:, 1:4:2]
    endpoints = np.empty((len(lines), 4))
    endpoints[:, 0::2] = c * x - s * y + poses[of, 0, None]
    endpoints[:, 1::2] = s * x + c * y + poses[of, 1, None]
    number = np.arange(len(lines)) - np.cumsum([0, *counts])[of]
    return LineObservations(
        endpoints=endpoints,
        sigma=np.sqrt(lines[:, VAR_OFFSET]),
        weight=np.ones(len(lines)),
        keyframe=keyframe,
        robot=np.zeros(len(lines), dtype=np.int64),
        stamp=np.zeros(len(lines)),
        id=keyframe * _LINES_PER_KEYFRAME + number,
    )
