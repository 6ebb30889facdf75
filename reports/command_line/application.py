"""The commands together, and the one place where errors become an exit code and a line on stderr."""

from __future__ import annotations

import sys
import traceback
import warnings
from collections.abc import Sequence
from typing import Annotated

import typer

from certify.float_range import BEYOND
from certify.lifetime import WorkerLostError
from reports.command_line import (
    check,
    derive,
    export,
    falsify,
    gains,
    init,
    normal_form,
    region,
    report,
    run,
    simulate,
    verify,
)
from reports.command_line.outcome import BAD_INPUT, UNDECIDED, Outcome
from reports.command_line.terminal import spell_out_what_is_missing
from symbolic.errors import InputError, one_line

INTERRUPTED = 130

app = typer.Typer(pretty_exceptions_enable=False, rich_markup_mode=None)
app.command("init")(init.command)
app.command("normal-form")(normal_form.command)
app.command("run")(run.command)
app.command("check")(check.command)
app.command("derive")(derive.command)
app.command("gains")(gains.command)
app.command("verify")(verify.command)
app.command("simulate")(simulate.command)
app.command("falsify")(falsify.command)
app.command("region")(region.command)
app.command("report")(report.command)
app.command("export")(export.command)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(version("consensus-certify"))
        raise typer.Exit


@app.callback()
def certify(
    _version: Annotated[
        bool, typer.Option("--version", help="Print the version.", is_eager=True, callback=_show_version)
    ] = False,
) -> None:
    """Certify distributed optimal output consensus of uncertain nonlinear agents.

    Exit codes: 0 holds, certified, verified, survived or simulated; 1 refuted or rejected; 2 bad input or usage; 3 not
    decided; 130 and 143 interrupted.
    """


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code (spec.md, command line)."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    spell_out_what_is_missing()
    with warnings.catch_warnings():
        if not sys.warnoptions:
            warnings.simplefilter("ignore")  # of a library to its caller; what a user must know is in the outcome
        return _run(given)


def _run(given: Sequence[str]) -> int:
    try:
        code = app(args=given, prog_name="certify", standalone_mode=False)
    except InputError as error:
        return max([_complain(line, BAD_INPUT) for line in error.lines], default=BAD_INPUT)
    except typer.TyperException as error:
        return _complain(f"{error.format_message()} (see certify --help)", BAD_INPUT)
    except (KeyboardInterrupt, typer.Abort):
        return _complain("interrupted", INTERRUPTED)
    except WorkerLostError as error:
        return _stopped(str(error), given)
    except OverflowError:
        return _stopped(BEYOND, given)
    except Exception as error:  # noqa: BLE001 - a crash would leave with 1, which means refuted
        traceback.print_exc()
        return _stopped(f"internal error: {type(error).__name__}: {error}", given)
    return code if isinstance(code, int) else 0


def _stopped(reason: str, given: Sequence[str]) -> int:
    if "--json" in given:
        print(Outcome("inconclusive", {"reason": reason}, "").as_json())
    return _complain(reason, UNDECIDED)


def _complain(reason: str, code: int) -> int:
    print(f"certify: {one_line(reason)}", file=sys.stderr)
    return code
