"""The command line: one command a file."""

from lineloom.cli.app import main

__all__ = ["main"]
