"""Places: submaps that are recognised without any pose."""

from lineloom_core.places.place import Glimpse, Place, count_points
from lineloom_core.places.recognition import (
    Recognition,
    RecognitionConfig,
    alias_evidence,
    evidence_elsewhere,
    hypotheses,
    recognise,
)

__all__ = [
    "Glimpse",
    "Place",
    "Recognition",
    "RecognitionConfig",
    "alias_evidence",
    "count_points",
    "evidence_elsewhere",
    "hypotheses",
    "recognise",
]
