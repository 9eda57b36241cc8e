"""The thesis's matcher, chapters 3 to 5, to be read beside the text (`core/docs/thesis.md`)."""

from lineloom_core.matching.thesis.config import PrimitiveConfig, ThesisConfig, Windows
from lineloom_core.matching.thesis.matcher import Description, ThesisMatcher
from lineloom_core.matching.thesis.primitives import Primitives, extract_primitives

__all__ = [
    "Description",
    "PrimitiveConfig",
    "Primitives",
    "ThesisConfig",
    "ThesisMatcher",
    "Windows",
    "extract_primitives",
]
