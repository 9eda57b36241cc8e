"""The JSON of the map. Lines that did not change are not written again."""

from __future__ import annotations

from collections.abc import Collection

from lineloom import wire
from lineloom_core.io.selection import BBox, clip
from lineloom_core.mapping.answers.site_view import ComponentView, MapLine, SiteView

from lineloom_service.convert import to_line
from lineloom_service.maps.line_history import LineTable


def write_line(line: MapLine) -> str:
    """Return a line's JSON."""
    return to_line(line).model_dump_json()


def write_map(
    site: str,
    view: SiteView,
    table: LineTable,
    component: str | None,
    box: BBox | None,
    since: int | None = None,
    since_settled: bool = False,
    layers: Collection[str] = wire.USUAL_LAYERS,
) -> bytes:
    """Return the answer: the lines chosen, or what of them changed after version `since`.

    Where that version is not one that this process has answered with before (too old, or from
    before a restart), it is the whole map, and says so by `full`. What moved as that version
    settled is told again unless who asks has it from then: `since_settled`.
    """
    components = [c for c in view.components if component is None or c.id == component]
    known = since is not None and (since in table.known)
    by_component: dict[str, list[str]] = {c.id: [] for c in components}
    left: list[str] = []
    for name, written in table.lines.items():
        if known and since is not None and written.since <= (since, since_settled):
            continue
        place = by_component.get(written.line.component)
        chosen = written.line.layer in layers and _touches(written.line, box)
        if place is not None and chosen:
            place.append(written.json)
        elif known:
            # Changed so that it is no longer among those asked for; or never was.
            left.append(name)
    lines = ",".join(json for c in components for json in by_component[c.id])
    head = wire.MapAnswer.model_construct(
        site=site,
        version=view.version,
        settled=view.settled,
        components=[_component(c) for c in components],
        lines=[],
    ).model_dump_json(exclude_unset=True)
    text = f"{head.removesuffix('[]}')}[{lines}]"
    if since is not None:
        if known:
            here = since, since_settled
            left += [name for name, stage in table.removed.items() if stage > here]
        text += (
            "," + wire.MapChanges(since=since, full=not known, removed=left).model_dump_json()[1:-1]
        )
    return (text + "}").encode()


def _component(component: ComponentView) -> wire.MapComponent:
    return wire.MapComponent(id=component.id, robots=list(component.robots))


def _touches(line: MapLine, box: BBox | None) -> bool:
    return box is None or clip((line.x1, line.y1, line.x2, line.y2), box) is not None
