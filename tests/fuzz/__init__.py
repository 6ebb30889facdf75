"""Broken and hostile input for the readers of plant files and certificates: ``python -m tests.fuzz``."""
