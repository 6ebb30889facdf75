"""Matplotlib keeps a list of fonts: here in a folder that lasts as long as the process and leaves nothing behind."""

from __future__ import annotations

import atexit
import os
from contextlib import ExitStack

from certify.files import temporary_folder


def prepare_drawing() -> None:
    """To be called before matplotlib is imported. A folder that the user chose is kept."""
    if "MPLCONFIGDIR" in os.environ:
        return
    until_the_end = ExitStack()
    atexit.register(until_the_end.close)
    os.environ["MPLCONFIGDIR"] = str(until_the_end.enter_context(temporary_folder()))
