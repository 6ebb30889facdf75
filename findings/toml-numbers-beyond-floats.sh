#!/usr/bin/env bash
# TOML readers and numbers that no binary float holds. tomllib, tomli 2.2.1 and tomlkit 0.13.2 read the finite decimal
# 1e400 as infinity and 1e-400 as 0, without a word; rtoml 0.12.0 refuses the first and takes the second as 0. An
# integer of 23 digits is exact in the first three and an "invalid number" in rtoml. So a file says something else to
# every reader; only tomllib's parse_float sees the digits as they are written.
# Output seen: tomllib, tomli, tomlkit: inf, 0.0, 12345678901234567890123; rtoml: refused, 0.0, refused
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet tomli==2.2.1 tomlkit==0.13.2 rtoml==0.12.0
"$place/venv/bin/python" - <<'PYTHON'
import importlib
import sys
import tomllib

NUMBERS = ("1e400", "1e-400", "12345678901234567890123")


def read(module, number):
    try:
        return str(module.loads(f"x = {number}")["x"])
    except Exception as error:
        return f"refused ({type(error).__name__})"


found = {name: [read(importlib.import_module(name), n) for n in NUMBERS] for name in ("tomllib", "tomli", "tomlkit", "rtoml")}
print(f"Python {sys.version.split()[0]}")
for name, values in found.items():
    print(f"{name}: {', '.join(values)}")
for name in ("tomllib", "tomli", "tomlkit"):
    assert found[name] == ["inf", "0.0", NUMBERS[2]], "the behaviour has changed"
assert found["rtoml"] == ["refused (TomlParsingError)", "0.0", "refused (TomlParsingError)"], "the behaviour has changed"
assert tomllib.loads("x = 1e400", parse_float=str)["x"] == "1e400"
PYTHON
