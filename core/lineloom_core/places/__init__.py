"""Places: the last metres of a robot's way, recognised without any pose."""

from lineloom_core.places.index import PlaceIndex
from lineloom_core.places.place import (
    PLACE_GATE,
    Glimpse,
    Place,
    Seen,
    Sight,
    conflicting_points,
    count_points,
    count_steady,
    count_steady_each_way,
    share_explained,
)
from lineloom_core.places.recognition import (
    Recognition,
    RecognitionConfig,
    check_alignment,
    evidence_elsewhere,
    evidence_for,
    evidence_of,
    hypotheses,
    is_rival,
    missing_share,
    recognise,
    rivals,
)

__all__ = [
    "PLACE_GATE",
    "Glimpse",
    "Place",
    "PlaceIndex",
    "Recognition",
    "RecognitionConfig",
    "Seen",
    "Sight",
    "check_alignment",
    "conflicting_points",
    "count_points",
    "count_steady",
    "count_steady_each_way",
    "evidence_elsewhere",
    "evidence_for",
    "evidence_of",
    "hypotheses",
    "is_rival",
    "missing_share",
    "recognise",
    "rivals",
    "share_explained",
]
