"""What one scan changed."""

from __future__ import annotations

from dataclasses import dataclass

from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.merging.component_merged import ComponentMerged


@dataclass(frozen=True, slots=True)
class Changes:
    """The answer of `SiteMapper.add`, and what `advance` says of a keyframe alone.

    placed: the scan has a pose. started_component: the scan opened a new component.
    keyframe: id of the keyframe made of it. merges: components joined now. withdrawn: constraints
    that the scan showed to be wrong, and that are as if they had never been accepted. optimised:
    the pose graph moved, so poses and lines of before are out of date.
    """

    placed: bool
    started_component: str | None = None
    keyframe: str | None = None
    merges: tuple[ComponentMerged, ...] = ()
    withdrawn: tuple[Constraint, ...] = ()
    optimised: bool = False
