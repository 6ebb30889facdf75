"""The command ``certify``."""

from reports.command_line.application import main

__all__ = ["main"]
