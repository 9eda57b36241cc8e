"""Pose-free matching of 2D laser scans by line segments, and multi-robot mapping built on it."""

__version__ = "0.1.0"
