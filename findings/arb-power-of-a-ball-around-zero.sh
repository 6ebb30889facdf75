#!/usr/bin/env bash
# python-flint 0.9.0: `arb ** 2` of a ball whose middle is exactly 0 is NaN, though `x*x` is finite and so is the
# square of the same ball moved by its last bit. The integer exponent is taken as a real one, and the power goes
# through the logarithm unless the middle is nonzero. A deviation that has vanished to rounding is such a ball.
# Output seen: x = [+/- 1.01e-38]; x**2 = nan, x**3 = nan; x*x = [+/- 1.01e-76]; moved: finite
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet python-flint==0.9.0
"$place/venv/bin/python" - <<'PYTHON'
import flint
from flint import arb

x, moved = arb(0, 1e-38), arb(2.0**-200, 1e-38)
print(f"python-flint {flint.__version__}: x = {x}; x**2 = {x**2}, x**3 = {x**3}; x*x = {x * x}; moved: {moved**2}")
assert not (x**2).is_finite() and not (x**3).is_finite(), "the behaviour has changed"
assert (x * x).is_finite() and (moved**2).is_finite()
PYTHON
