"""Matplotlib keeps a list of fonts: here in a folder that lasts as long as the process and leaves nothing behind."""

from __future__ import annotations

import atexit
import os
import tempfile


def prepare_drawing() -> None:
    """To be called before matplotlib is imported. A folder that the user chose is kept."""
    if "MPLCONFIGDIR" in os.environ:
        return
    folder = tempfile.TemporaryDirectory(prefix="certify-")
    atexit.register(folder.cleanup)
    os.environ["MPLCONFIGDIR"] = folder.name
