"""From the walls as every keyframe saw them to one line per wall."""

from lineloom_core.fusion.fuse import fuse
from lineloom_core.fusion.merge import FusionConfig
from lineloom_core.fusion.segment_map import FusedLines, LineObservations

__all__ = ["FusedLines", "FusionConfig", "LineObservations", "fuse"]
