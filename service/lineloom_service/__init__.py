"""Lineloom over HTTP: scans in, one merged line map out."""

from importlib.metadata import version

__version__ = version("lineloom-service")
