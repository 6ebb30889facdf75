"""Inputs: valid files with bytes changed, files put together from a grammar, and hostile expressions in a valid
file."""

from __future__ import annotations

import json
import random
from collections.abc import Sequence
from dataclasses import dataclass

from .vocabulary import FUNCTIONS, NAMES, NUMBERS, SLOTS, TOKENS


@dataclass(frozen=True)
class Input:
    """``kind`` is ``plant`` or ``certificate``; ``how`` says how it was made."""

    kind: str
    how: str
    data: bytes


def make(rng: random.Random, plants: Sequence[bytes], certificates: Sequence[bytes]) -> Input:
    """One input, a function of the state of ``rng`` and the seeds."""
    choice = rng.random()
    if choice < 0.40:
        kind, seeds = ("plant", plants) if rng.random() < 0.6 else ("certificate", certificates)
        return Input(kind, "bytes", _bytes(rng, seeds))
    if choice < 0.60:
        return Input("plant", "expression", _with_expression(rng))
    if choice < 0.75:
        return Input("plant", "grammar", _toml(rng).encode("utf-8", "surrogatepass"))
    if choice < 0.90:
        return Input("certificate", "grammar", _json(rng, certificates))
    if choice < 0.995:
        return Input("certificate", "structure", _structure(rng, certificates))
    return Input(rng.choice(["plant", "certificate"]), "blow-up", _blow_up(rng, plants))


def _bytes(rng: random.Random, seeds: Sequence[bytes]) -> bytes:
    """A few small changes: bits, deletions, repetitions, tokens, and pieces of another file."""
    data = bytearray(rng.choice(seeds))
    for _ in range(rng.choice([1, 1, 1, 2, 3, 8])):
        at, kind = rng.randrange(len(data) + 1), rng.randrange(8)
        length = rng.choice([1, 1, 2, 5, 20, 200])
        if kind == 0 and at < len(data):
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del data[at : at + length]
        elif kind == 2:
            data[at:at] = data[at : at + length] * rng.choice([1, 2, 50])
        elif kind in (3, 4):
            token = rng.choice(TOKENS).encode("utf-8", "surrogatepass")
            data[at : at + (len(token) if kind == 4 else 0)] = token
        elif kind == 5:
            other = rng.choice(seeds)
            start = rng.randrange(len(other))
            data[at : at + length] = other[start : start + length]
        elif kind == 6:
            data[at : at + length] = bytes(rng.randrange(256) for _ in range(length))
        else:
            data = data[:at] if rng.random() < 0.3 else data
            lines = bytes(data).split(b"\n")
            first, second = rng.randrange(len(lines)), rng.randrange(len(lines))
            lines[first], lines[second] = lines[second], lines[first]
            data = bytearray(b"\n".join(lines))
    return bytes(data)


def expression(rng: random.Random, depth: int) -> str:
    """From the grammar of expressions, with parts that do not belong to it."""
    kind = rng.randrange(10)
    if depth <= 0 or kind < 2:
        return rng.choice(NAMES) if rng.random() < 0.5 else rng.choice(NUMBERS)
    if kind < 6:
        operator = rng.choice(
            ["+", "-", "*", "/", "**", "^", "+", "*", "//", "%", "@", "==", ",", "<", "|"][: rng.choice([6, 6, 6, 15])]
        )
        return f"{expression(rng, depth - 1)}{rng.choice(['', ' '])}{operator}{expression(rng, depth - 1)}"
    if kind < 8:
        return f"{rng.choice(FUNCTIONS[: rng.choice([10, 10, 16])])}({expression(rng, depth - 1)})"
    return f"({expression(rng, depth - 1)})" if kind == 8 else f"-{expression(rng, depth - 1)}"


def _hostile(rng: random.Random) -> str:
    n = rng.choice([10, 100, 1000, 5000])
    return rng.choice(
        [
            "(" * n + "s" + ")" * n,
            "-" * n + "s",
            "s" + "**2" * n,
            "s" + "^-1" * n,
            "+".join(["s"] * n),
            "sin(" * n + "s" + ")" * n,
            "9**9**9**9",
            "2^64^64",
            "1/" * n + "1",
            "s/(s-s)",
            "0**0",
            "0^-1",
            "log(0)",
            "sqrt(-1)",
            "tan(1e400)",
            "exp(" * 8 + "9" + ")" * 8,
            "1" * n,
            "0." + "1" * n,
            "a" * n,
            "s " * n,
            "(s+x1+z1+p)^64",
            "((s+x1+z1+p)^64)^64",
            "exp(exp(exp(exp(s))))",
            "1e" + "9" * n,
            "__import__('os').system('touch fuzzed')",
            "s.__class__.__mro__",
            "lambda: 0",
            "[x for x in ()]",
            "{}",
            "f'{s}'",
            "s;s",
            "s\ns",
            "s\\",
            "s#s",
            "'s'",
            "\N{DIGIT ONE}",
            "s\u00a0+1",
            "s\u22121",
            "\u0455",
            "𝑠",
            "sqrt(sqrt(sqrt(" * 5 + "2" + ")))" * 5,
            "sin(1)^2 + cos(1)^2 - 1",
            "(1+1e-300)^64",
            "log(exp(1e9))",
            "cosh(1e6)",
            "atan(tan(100))",
            "x1*" * n + "x1",
        ]
    )


def _with_expression(rng: random.Random) -> bytes:
    """A small valid plant file with a random or hostile expression in one place."""
    text = _hostile(rng) if rng.random() < 0.35 else expression(rng, rng.randint(0, 6))
    quoted = json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
    slot = rng.choice(SLOTS)
    values = dict.fromkeys(SLOTS, "0") | {
        "f": '"p*x2 + z1"',
        "b": "1",
        "cost": '"s^2/2"',
        "S": "1",
        "box": "1",
        "weight": "1",
        "constant": '"4/5"',
        "zero_dynamics": '"-z1 + x1"',
        "steady_state": '"s"',
        "lyapunov": '"z1^2"',
        "uncertain": "1",
        "gain": "100",
    }
    values[slot] = quoted
    return f"""schema = "consensus-plant/1"
name = "fuzz"
[network]
agents = 2
edges = ["1 -> 2", ["2 -> 1", {values["weight"]}]]
[constants]
theta = {values["constant"]}
A = "2*theta"
[exosystem]
states = ["v1", "v2"]
S = [[0, {values["S"]}], [-1, 0]]
initial = {{ v1 = 0, v2 = [-1, {values["box"]}] }}
[initial]
box = [-1, {values["box"]}]
[[agent]]
ids = [1, 2]
zero_dynamics = {{ z1 = {values["zero_dynamics"]} }}
order = 2
f = {values["f"]}
b = {values["b"]}
cost = {values["cost"]}
uncertain = {{ p = [-1, {values["uncertain"]}] }}
steady_state = {{ z1 = {values["steady_state"]} }}
zero_dynamics_lyapunov = {values["lyapunov"]}
[gains]
K = {values["gain"]}
""".encode("utf-8", "surrogatepass")


def _value(rng: random.Random, depth: int) -> str:
    kind = rng.randrange(9)
    if depth > 0 and kind < 2:
        return "[" + ", ".join(_value(rng, depth - 1) for _ in range(rng.choice([0, 1, 2, 3, 40]))) + "]"
    if depth > 0 and kind == 2:
        return (
            "{ "
            + ", ".join(f"{rng.choice(TOKENS[58:])} = {_value(rng, depth - 1)}" for _ in range(rng.randint(0, 4)))
            + " }"
        )
    if kind < 5:
        return json.dumps(expression(rng, 3), ensure_ascii=False)
    return rng.choice(TOKENS)


def _toml(rng: random.Random) -> str:
    lines = ['schema = "consensus-plant/1"', 'name = "fuzz"'] if rng.random() < 0.7 else []
    for _ in range(rng.randint(0, 25)):
        key = ".".join(rng.choice(TOKENS[58:]) for _ in range(rng.choice([1, 1, 1, 1, 2, 40])))
        kind = rng.randrange(6)
        if kind == 0:
            lines.append(f"[{key}]")
        elif kind == 1:
            lines.append(f"[[{key}]]")
        else:
            lines.append(f"{key} = {_value(rng, 3)}")
    return "\n".join(lines)


def _scalar(rng: random.Random) -> object:
    return rng.choice(
        [
            None,
            True,
            0,
            1,
            -1,
            0.5,
            1e300,
            "",
            "0",
            "1",
            "-1",
            "1/2",
            "2/4",
            "01",
            "-0",
            "1/0",
            "1e5",
            "½",
            "9" * 4001,
            "s",
            "z1",
            "x" * 10_001,
            "\ud800",
            "\0",
            10**4000,
            [],
            {},
            [[]],
            "0" * 64,
        ]
    )


def _json(rng: random.Random, seeds: Sequence[bytes]) -> bytes:
    """A certificate with random values in some places, or random JSON."""

    def random_value(depth: int) -> object:
        if depth <= 0 or rng.random() < 0.5:
            return _scalar(rng)
        if rng.random() < 0.5:
            return [random_value(depth - 1) for _ in range(rng.choice([0, 1, 2, 3, 600 if depth == 1 else 4]))]
        keys = [
            rng.choice(["schema", "theorem", "producer", "claim", "witness", "agents", "id", "P", "extra", ""])
            for _ in range(rng.randint(0, 6))
        ]
        return {key: random_value(depth - 1) for key in keys}

    def walk(value: object) -> object:
        if rng.random() < 0.01:
            return random_value(2)
        if isinstance(value, dict):
            return {key: walk(entry) for key, entry in value.items()}
        return [walk(entry) for entry in value] if isinstance(value, list) else value

    value = walk(json.loads(rng.choice(seeds))) if rng.random() < 0.8 else random_value(4)
    return _dump(rng, value)


def _structure(rng: random.Random, seeds: Sequence[bytes]) -> bytes:
    """Lists and tables of a certificate dropped, repeated, exchanged or enlarged."""
    value = json.loads(rng.choice(seeds))
    for _ in range(rng.randint(1, 3)):
        here = value
        while isinstance(here, (dict, list)) and here and rng.random() < 0.8:
            key = rng.choice(list(here)) if isinstance(here, dict) else rng.randrange(len(here))
            if not isinstance(here[key], (dict, list)):
                break
            here = here[key]
        if isinstance(here, list) and here:
            entry = rng.choice(here)
            many = rng.choice([2, 300]) if len(here) < 20 else 2
            square = [[entry] * 100] * 100 if isinstance(entry, str) else [entry] * 3
            here[:] = rng.choice([here[::-1], here * many, here[1:], [*here, entry], square, [here[:]]])
        elif isinstance(here, dict) and here:
            key = rng.choice(list(here))
            here[rng.choice([key, key + "x", "extra"])] = here.pop(key) if rng.random() < 0.5 else _scalar(rng)
    return _dump(rng, value)


def _dump(rng: random.Random, value: object) -> bytes:
    if rng.random() < 0.9:
        return json.dumps(value, sort_keys=True, separators=(",", ":")).encode() + b"\n"
    return json.dumps(value, indent=rng.choice([None, 1])).encode()


def _blow_up(rng: random.Random, plants: Sequence[bytes]) -> bytes:
    """Large or deep input near and beyond every limit."""
    n = rng.choice([100, 1000, 10_000, 100_000])
    seed = rng.choice(plants)
    return rng.choice(
        [
            lambda: b"[" * n + b"]" * n,
            lambda: b'{"a":' * n + b"1" + b"}" * n,
            lambda: b"a = " + b"[" * n + b"]" * n,
            lambda: b"a" + b".a" * n + b" = 1",
            lambda: b"[" + b"a." * n + b"a]",
            lambda: b"[[agent]]\n" * n,
            lambda: seed + b"[[agent]]\nids=[1]\n" * min(n, 10_000),
            lambda: b"#" * n,
            lambda: b'"' * n,
            lambda: b"a = {" + b"b = {" * n,
            lambda: b"\n" * n * 10,
            lambda: seed * rng.choice([2, 100]),
            lambda: b"x = " + b"1" * n,
            lambda: b'x = "' + b"\\" * n + b'"',
            lambda: b"\xff" * n,
            lambda: b"".join(b"a%d = 1\n" % k for k in range(min(n, 60_000))),
            lambda: b"[" + b"1," * n + b"1]\n",
            lambda: b'"' + b"\\u0000" * n + b'"',
            lambda: b"a = [" + b"1," * n + b"]",
            lambda: b"x = 0." + b"0" * n + b"1",
            lambda: b"x = 1e" + b"9" * n,
            lambda: b"-" * n,
            lambda: b"{" * n,
            lambda: b'{"a":1,' * n,
            lambda: b"1" * n,
            lambda: b"[" + b'"0",' * n + b'"0"]\n',
            lambda: b"".join(b"[a%d]\n" % k for k in range(min(n, 60_000))),
            lambda: (
                b"[constants]\n" + b"".join(b'c%d = "c%d + c%d"\n' % (k, k - 1, k - 1) for k in range(1, min(n, 5000)))
            ),
            lambda: seed.replace(
                b"[network]",
                b'[constants]\nk0 = "sqrt(2)"\n'
                + b"".join(b'k%d = "k%d + 1"\n' % (k, k - 1) for k in range(1, min(n, 900)))
                + b"[network]",
            ),
            lambda: seed.replace(b"[network]", _chain(rng, min(n, 900)) + b"[network]"),
            lambda: seed.replace(b"agents = ", b"agents = 99"),
            lambda: seed.replace(b"order", b"order = 16 #"),
            lambda: seed[: len(seed) // 2] * 50,
        ]
    )()


def _chain(rng: random.Random, length: int) -> bytes:
    """Constants each of which is made from the one before it."""
    links = ("sin(k)", "1/(1 + k)", "sqrt(k + 1)", "k*k", "2*(k + 1)", "exp(k/9)", "-k", "k + 1/k", "(((k)))^2")
    link = rng.choice(links)
    lines = [f'k{j} = "{link.replace("k", f"k{j - 1}")}"' for j in range(1, length)]
    return "\n".join(["[constants]", f'k0 = "{rng.choice(["sqrt(2)", "3"])}"', *lines, ""]).encode()
