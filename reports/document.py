"""The PDF report: a study becomes plain data, and Typst sets that data with the templates beside this file.

Templates are code, everything else is data: strings of a plant file reach Typst as JSON and are shown, never evaluated.
"""

from __future__ import annotations

import json
from datetime import UTC, datetime, time
from pathlib import Path
from typing import Any

import typst

from certify.files import write_atomically
from reports.sections import document_data
from reports.study import Study

TEMPLATES = Path(__file__).parent / "templates"
MAIN = TEMPLATES / "report.typ"


def build_report(study: Study, path: Path | None = None) -> bytes:
    """The report as the bytes of a PDF, also written (whole or not at all) to ``path``.

    The bytes depend on the study alone: only the fonts inside the Typst package are used, and the PDF carries the
    study's date (the beginning of 1970 without one). Raises ``InputError`` if ``path`` cannot be written.
    """
    pdf = typeset(document_data(study), timestamp(study))
    if path is not None:
        write_atomically(path, pdf)
    return pdf


def timestamp(study: Study) -> int:
    """Midnight UTC of the study's date, in seconds since 1970."""
    return 0 if study.date is None else int(datetime.combine(study.date, time(), UTC).timestamp())


def typeset(data: dict[str, Any], seconds: int) -> bytes:
    """The templates set with the data, without fonts, files or packages of the machine."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False)
    return bytes(
        typst.compile(
            str(MAIN),
            root=str(TEMPLATES),
            format="pdf",
            ignore_system_fonts=True,
            sys_inputs={"data": text},
            timestamp=seconds,
        )
    )
