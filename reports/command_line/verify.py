"""``certify verify``: the independent checker."""

from __future__ import annotations

import contextlib
import io
import sys

import typer

from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument
from reports.command_line.outcome import BAD_INPUT, HOLDS, Outcome, finish


def command(plant: PlantArgument, certificate: CertificateArgument, as_json: JsonOption = False) -> None:
    """Check a certificate against the plant; prints VERIFIED and the digest of the claim."""
    from certify.checker.__main__ import main as checker

    files = [str(plant), str(certificate)]
    if not as_json:
        raise typer.Exit(checker(files))
    said, complained = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(complained):
        code = checker(files)
    reason = complained.getvalue().strip()
    if code == BAD_INPUT:
        print(reason, file=sys.stderr)
        raise typer.Exit(code)
    finish(outcome(code, said.getvalue(), reason), as_json)


def outcome(code: int, said: str, reason: str) -> Outcome:
    """The checker's answer as JSON. Only exit code 0 together with its one success line counts as verified."""
    words = said.split()
    if code == HOLDS and len(words) == 2 and words[0] == "VERIFIED":
        return Outcome("verified", {"claim_sha256": words[1], "reason": ""}, said)
    return Outcome("rejected", {"claim_sha256": None, "reason": reason}, "")
