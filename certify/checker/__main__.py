"""``python -m certify.checker PLANT CERT`` prints ``VERIFIED <sha256 of the claim>`` and exits with 0.

Otherwise stdout stays empty, one line on stderr says why, and the exit code is 1 for a certificate that proves nothing
and 2 for bad input.
"""

from __future__ import annotations

import sys

from certify.checker import certificate, plant
from certify.checker.checking import check


def main(arguments: list[str]) -> int:
    if len(arguments) != 2:
        print("usage: python -m certify.checker PLANT CERT", file=sys.stderr)
        return 2
    try:
        verdict = check(_read(arguments[0], plant.MAX_BYTES), _read(arguments[1], certificate.MAX_BYTES))
    except (OSError, ValueError) as error:
        print(_line(f"malformed: {error}"), file=sys.stderr)
        return 2
    if verdict.status == "verified":
        print(f"VERIFIED {verdict.claim_sha256}")
        return 0
    parts = (verdict.status, verdict.obligation, verdict.detail)
    print(_line(": ".join(part for part in parts if part)), file=sys.stderr)
    return 2 if verdict.status == "malformed" else 1


def _read(path: str, most: int) -> bytes:
    """At most one byte more than allowed, so that a larger file is refused without being read."""
    with open(path, "rb") as file:
        return file.read(most + 1)


def _line(text: str) -> str:
    """One printable line of bounded length."""
    shown = "".join(character if character.isprintable() else ascii(character)[1:-1] for character in text)
    return shown if len(shown) <= 600 else shown[:599] + "…"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
