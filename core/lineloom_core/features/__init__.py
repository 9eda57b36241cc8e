"""Primitives of a scan: line segments, end points, edges (thesis chapter 3) and circles."""

from lineloom_core.features._kernels import EDGE, INTERIOR, UNKNOWN
from lineloom_core.features.extract import ExtractionConfig, ScanFeatures, extract_features

__all__ = ["EDGE", "INTERIOR", "UNKNOWN", "ExtractionConfig", "ScanFeatures", "extract_features"]
