"""The parameters of `localise`."""

from __future__ import annotations

from dataclasses import dataclass, field

from lineloom_core.places import RecognitionConfig


@dataclass(frozen=True, slots=True)
class LocaliseConfig:
    """Parameters of `localise`; metres, radians, shares 0..1.

    recognition: how places are matched. spots: hypotheses that are held against all that is known
    around them. same_distance, same_angle: within them, two hypotheses are one. surround: how far
    around a hypothesis keyframes count. most_keyframes: of them at most. least_matched: points
    (cells of 0.1 m) on known surfaces, least_explained: their share of the query, without which
    nothing is known; most_conflict: the share that may contradict. least_margin: lead over the
    best rival. least_information: [1/m^2] as in recognition. least_places: places in the component
    and its neighbours, so that it is known what else looks alike. least_score: how sure a "unique"
    must be.
    """

    recognition: RecognitionConfig = field(
        default_factory=lambda: RecognitionConfig(least_explained=3.0, coarse_keep=12)
    )
    spots: int = 10
    same_distance: float = 0.5
    same_angle: float = 0.15
    surround: float = 8.0
    most_keyframes: int = 16
    least_matched: float = 40.0
    least_explained: float = 0.3
    most_conflict: float = 0.15
    least_margin: float = 0.15
    least_information: float = 2.0e3
    least_places: int = 3
    least_score: float = 0.9
