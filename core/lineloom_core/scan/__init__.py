"""One sweep of a 2D lidar: the model, its validation, and its points."""

from lineloom_core.scan.mount import Mount
from lineloom_core.scan.scan import MAX_BEAMS, InvalidScanError, Scan

__all__ = ["MAX_BEAMS", "InvalidScanError", "Mount", "Scan"]
