"""Ten thousand trajectories inside each example's certificate, and the worst margin.

    python benchmarks/cross_check.py [--count 10000] [--horizon 40] [--certificates DIR] [NAME …]

Every example plant for which route direct finds a certificate, or those named. With ``--certificates`` the certificates
are kept in that folder and used again for the same plant file, so that only the trajectories cost time; delete them
when the route has changed. Each trajectory must converge and keep the bounds that the certificate proves. Compiled
where numba is installed. Exit 1 if one breaks its claim. Prints the table of docs/simulation.md.
"""

from __future__ import annotations

import argparse
import sys
import time
from importlib.util import find_spec
from pathlib import Path

from certify.certificate import Json, read_certificate, write_certificate
from certify.pipeline import design_gains
from certify.statement.bounds import proved_bounds
from certify.statement.claim import certified_gains
from certify.statement.controller import certified_controller
from certify.statement.recomputed import coordinator_envelope
from reports.cross_checked import ending
from sims.bounds import SignalBound
from sims.certified_bounds import signal_bounds
from sims.cross_check import cross_check
from sims.executors import processors
from sims.falsifier import HORIZON
from symbolic.derivation import derive
from symbolic.plant import COST_VARIABLE, Plant
from symbolic.plant_file import load_plant

EXAMPLES = Path(__file__).parent.parent / "examples"
UNLIMITED = 1e6  # seconds


def certificate_of(plant: Plant, kept: Path | None) -> Json | str:
    """That of the folder if it is about this plant file, else a new one, or why there is none."""
    if kept is not None and kept.exists():
        found = read_certificate(kept)
        if found["claim"]["plant_sha256"] == plant.sha256:
            return found
    result = design_gains(plant, route="direct")
    if result.certificate is None:
        return f"{result.status}: {result.reason}"
    if kept is not None:
        write_certificate(result.certificate, kept)
    return result.certificate


def signals_of(plant: Plant, certificate: Json) -> tuple[SignalBound, ...]:
    """The bounds of the certified region; none where they cannot be stated."""
    certified = certified_gains(certificate)
    if certified is None or not certified.has_tubes:
        return ()
    envelope = coordinator_envelope(plant, certified)
    if isinstance(envelope, str):
        return ()
    found = proved_bounds(plant, derive(plant, COST_VARIABLE), certified, envelope)
    return () if isinstance(found, str) else signal_bounds(found)


def row(path: Path, count: int, horizon: float, folder: Path | None) -> tuple[str, bool]:
    """A line of the table, and whether the claim was broken."""
    plant = load_plant(path)
    certificate = certificate_of(plant, None if folder is None else folder / f"{path.stem}.json")
    if isinstance(certificate, str):
        return f"| `{path.name}` | – | – | – | no certificate: {certificate} |", False
    controller = certified_controller(certificate, plant, path.name)
    bounds = signals_of(plant, certificate)
    share = -(-count // len(plant.agents))
    compiled = find_spec("numba") is not None
    begun = time.monotonic()
    found = cross_check(
        plant,
        controller,
        count=share,
        horizon=horizon,
        budget_seconds=UNLIMITED,
        bounds=bounds,
        compiled=compiled,
        workers=1 if compiled else processors(),
    )
    seconds = time.monotonic() - begun
    told = found.reason if found.broken else ending(found)
    slow = sum(tried.slow for tried in found.tried)
    told += f", {found.failed} not integrated" if found.failed else ""
    told += f", {slow} still converging" if slow else ""
    bounded = f"{len(bounds)} bounds" if bounds else "convergence only"
    margin = f"{found.worst_margin:.2g}"
    return f"| `{path.name}` | {found.count} ({seconds:.0f} s) | {bounded} | {margin} | {told} |", bool(found.broken)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="example plants, without .toml")
    parser.add_argument("--count", type=int, default=10_000, help="trajectories per plant")
    parser.add_argument("--horizon", type=float, default=HORIZON, help="seconds of each trajectory")
    parser.add_argument("--certificates", type=Path, help="folder in which certificates are kept")
    options = parser.parse_args()
    if options.certificates is not None:
        options.certificates.mkdir(parents=True, exist_ok=True)
    paths = [EXAMPLES / f"{name}.toml" for name in options.names] or sorted(EXAMPLES.glob("*.toml"))
    print("| plant | trajectories | checked against | worst margin | result |\n|---|---|---|---|---|")
    broken = False
    for path in paths:
        line, failed = row(path, options.count, options.horizon, options.certificates)
        print(line, flush=True)
        broken |= failed
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
