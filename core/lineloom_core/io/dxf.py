"""The map as a drawing for CAD (DXF R2010, in metres), by ezdxf.

ezdxf is imported when the first map is written: a service that starts need not wait for it.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from lineloom_core.io.drawing import robot_colour
from lineloom_core.io.selection import BBox, ComponentContent, select
from lineloom_core.mapping.answers.site_view import SiteView

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.layouts.layout import Modelspace

_INK = 7  # black on white, white on black
_VERSION = "R2010"
_SAME = "{00000000-0000-0000-0000-000000000000}"


def write_map(
    view: SiteView, component: str | None = None, bbox: BBox | None = None, site: str = ""
) -> str:
    """Return the map as DXF text.

    Per component the layers `<id>-walls` (LINE, free side left of start to end),
    `<id>-trajectories` (LWPOLYLINE) and `<id>-robots` (a POINT with a TEXT). $INSUNITS is metres.
    Components lie in unrelated frames, each at its own origin: ask for one to have one drawing.
    Raises as `selection.select` does.
    """
    from ezdxf import units
    from ezdxf.filemanagement import new

    contents = select(view, component, bbox)
    document = new(_VERSION, setup=False)
    document.units = units.M
    space = document.modelspace()
    names = sorted({*view.robots, *view.trajectories})
    colours = {name: _rgb(robot_colour(i)) for i, name in enumerate(names)}
    for content in contents:
        _draw(document, space, content, colours)
    return _text(document)


def _draw(
    document: Drawing,
    space: Modelspace,
    content: ComponentContent,
    colours: dict[str, tuple[int, int, int]],
) -> None:
    component = content.component.id
    walls, paths, robots = (f"{component}-{what}" for what in ("walls", "trajectories", "robots"))
    for layer in (walls, paths, robots):
        document.layers.add(layer, color=_INK)
    for line in content.lines:
        space.add_line((line.x1, line.y1), (line.x2, line.y2), dxfattribs={"layer": walls})
    for path in content.paths:
        points = path.poses[:, :2].tolist()
        if len(points) > 1:
            drawn = space.add_lwpolyline(points, dxfattribs={"layer": paths})
            drawn.rgb = colours[path.robot]
    for robot in content.robots:
        assert robot.pose is not None
        where = (robot.pose.x, robot.pose.y)
        space.add_point(where, dxfattribs={"layer": robots})
        space.add_text(robot.robot, height=0.25, dxfattribs={"layer": robots, "insert": where})


def _text(document: Drawing) -> str:
    """Return the document without what differs from run to run."""
    from ezdxf._options import options

    options.write_fixed_meta_data_for_testing = True
    document.header["$FINGERPRINTGUID"] = _SAME
    document.header["$VERSIONGUID"] = _SAME
    target = io.StringIO()
    document.write(target)
    return target.getvalue()


def _rgb(colour: str) -> tuple[int, int, int]:
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue
