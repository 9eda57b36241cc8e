"""Places: submaps that are recognised without any pose."""

from lineloom_core.places.place import (
    Glimpse,
    Place,
    conflicting_points,
    count_points,
    share_explained,
)
from lineloom_core.places.recognition import (
    Recognition,
    RecognitionConfig,
    alias_evidence,
    check_alignment,
    evidence_elsewhere,
    evidence_of,
    hypotheses,
    recognise,
    rivals,
)

__all__ = [
    "Glimpse",
    "Place",
    "Recognition",
    "RecognitionConfig",
    "alias_evidence",
    "check_alignment",
    "conflicting_points",
    "count_points",
    "evidence_elsewhere",
    "evidence_of",
    "hypotheses",
    "recognise",
    "rivals",
    "share_explained",
]
