"""``python -m tests.wrong > docs/messages.md``."""

from __future__ import annotations

from .catalogue import page

print(page(), end="")
