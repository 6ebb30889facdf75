"""Plant files that are valid, or wrong only in a name: what is declared bears names that mean something elsewhere."""

from __future__ import annotations

import json
import random
from collections.abc import Sequence
from dataclasses import dataclass

KEYS = (
    "schema name network agents edges constants exosystem states S initial box z x eta observer reference agent ids "
    "zero_dynamics order f b cost uncertain steady_state zero_dynamics_lyapunov internal_model M N gamma coordinator "
    "alpha1 alpha2 gradient_gain mixing_gain mixing_time softening period gains g K delta h requirements settling time "
    "band input bandwidth region implementation delay noise input_resolution arithmetic double single largest measured"
).split()
INTERNAL = (
    "lambda yr yr_dot e1 e2 eta1 eta2 xtilde1 zbar1 zstar1 z1_star z_star xhat1 xbar1 vartheta etatilde1 ubar f0_bar1 "
    "f1_bar epsilon gamma1 c1 k0 t0 rate0 bias free u y r xi xi1 zeta kappa beta nu omega tau rho V0 W P Q T Phi Psi E "
    "I oo zoo nan inf Symbol Function Integer Rational Pow Add True None self t _"
).split()
PLAIN = "p q a1 a2 v1 v2 w1 w2 z1 z2 z3 theta mass k_1 Temperature A0 e E2 e10".split()
TAKEN = "s id pi x1 x2 x17 sin sqrt exp".split()
SMOOTH = ("sin", "cos", "exp", "tanh", "atan", "sinh", "cosh")
INITIAL = ("box", "box", "box", "z", "x", "eta", "observer", "reference")  # keys of the table of the zero states' boxes
DEPTH = 2
SHARED_GAINS = ("g", "K", "delta", "h")


@dataclass
class Names:
    """Draws names that are new among those an agent sees; now and then one that is not."""

    rng: random.Random
    taken: set[str]

    def new(self, first: Sequence[str] = ()) -> str:
        """A name, for every third time one of the ``first``."""
        kind = self.rng.random()
        pool = (
            first
            if first and self.rng.random() < 0.33
            else KEYS
            if kind < 0.45
            else INTERNAL[:-1]
            if kind < 0.75
            else PLAIN
            if kind < 0.997
            else TAKEN
        )
        name = self.rng.choice(pool)
        while name in self.taken and self.rng.random() < 0.999:
            name = self.rng.choice((*KEYS, *PLAIN, *INTERNAL[:-1])) + str(self.rng.randrange(40))
        self.taken.add(name)
        return name


def valid_plant(rng: random.Random) -> bytes:
    """One file, a function of the state of ``rng``."""
    count = rng.choice([1, 2, 2, 3, 5])
    names = Names(rng, set())
    constants = _constants(rng, names, ["pi"], rng.randint(0, 3))
    known = list(constants)
    rational = [name for name, text in constants.items() if text in ("0.1", "3", _text("4/5"))]
    numbers = Numbers(rng, rational)
    exosystem = [names.new() for _ in range(rng.choice([0, 0, 1, 2, 3]))]
    lines = [f'schema = "consensus-plant/1"\nname = {_text("two " + rng.choice(KEYS))}', _network(rng, count)]
    if constants:
        lines.append(f"[constants]\n{_lines(rng, constants)}")
    if exosystem:
        lines.append(_exosystem(rng, exosystem, [*known, "pi"], numbers))
    agents, zero_states = [], []
    for ids in _shares(rng, count):
        text, z = _agent(rng, ids, Names(rng, set(names.taken)), [*known, "pi", "id"], exosystem, rational)
        agents.append(text)
        zero_states += z
    lines += [_initial(rng, zero_states, Numbers(rng, [*rational, "id"]), count == len(agents)), *agents]
    lines += _requested(rng, count, numbers)
    text = "\n".join(lines) + "\n"
    return (text.replace("\n", "\r\n") if rng.random() < 0.1 else text).encode()


@dataclass
class Numbers:
    """Values that are rational: TOML numbers and expressions of constants."""

    rng: random.Random
    names: Sequence[str]

    def value(self, least: int = -3) -> str:
        rng, size = self.rng, self.rng.randint(max(least, 1), 9)
        if least <= 0 and rng.random() < 0.1:
            return "0"
        if self.names and rng.random() < 0.2:
            return _text(f"{size} + {rng.choice(self.names)}^2")
        sign = "-" if least < 0 and rng.random() < 0.4 else ""
        plain = [f"{size}", f"{size}.25", f"{size}e-2", f"{size}_0.5", f"1e{rng.choice(['', '+', '-'])}0{size}"]
        texts = ["8^(1/3)", "sqrt(9/4)", "2^-3", f"{size}/7", "1.5^2"]
        return sign + rng.choice(plain) if rng.random() < 0.6 else _text(sign + rng.choice(texts))

    def interval(self) -> str:
        rng = self.rng
        if rng.random() < 0.15:
            return self.value()
        low = rng.choice(["-1", "-2.5", '"-1/3"', "0", '"-8^(1/3)"', *(_text(f"-{name}^2") for name in self.names)])
        return f"[{low}, {self.value(0)}]"


def _text(text: str) -> str:
    return json.dumps(text)


def _key(rng: random.Random, name: str) -> str:
    return _text(name) if rng.random() < 0.1 else name


def _lines(rng: random.Random, entries: dict[str, str]) -> str:
    return "\n".join(f"{_key(rng, name)} = {value}" for name, value in entries.items())


def _inline(rng: random.Random, entries: dict[str, str]) -> str:
    return "{ " + ", ".join(f"{_key(rng, name)} = {value}" for name, value in entries.items()) + " }"


def _constants(rng: random.Random, names: Names, known: list[str], count: int) -> dict[str, str]:
    made: dict[str, str] = {}
    for _ in range(count):
        other = rng.choice([*known, *made])
        texts = map(_text, ("4/5", "sqrt(2)", "2^(1/3)", f"2*{other}", f"3 - {other}"))
        made[names.new()] = rng.choice(["0.1", "3", *texts])
    return made


def _network(rng: random.Random, count: int) -> str:
    edges = [f"{i} -> {i % count + 1}" for i in range(1, count + 1)] if count > 1 else []
    weight = rng.choice(["1.5", "2", _text("1/3")])
    shown = [_text(edge) if rng.random() < 0.7 else f"[{_text(edge)}, {weight}]" for edge in edges]
    return f"[network]\nagents = {count}\nedges = [{', '.join(shown)}]"


def _exosystem(rng: random.Random, states: list[str], constants: list[str], numbers: Numbers) -> str:
    entries = ["0", "1", "-1", "0.8", *(_text(f"-{name}") for name in constants)]
    rows = [[rng.choice(entries) for _ in states] for _ in states]
    initial = _inline(rng, {name: numbers.interval() for name in rng.sample(states, len(states))})
    matrix = ", ".join(f"[{', '.join(row)}]" for row in rows)
    return f"[exosystem]\nstates = [{', '.join(map(_text, states))}]\nS = [{matrix}]\ninitial = {initial}"


def _shares(rng: random.Random, count: int) -> list[list[int]]:
    """The agents 1 … count, shared out among tables."""
    numbers = rng.sample(range(1, count + 1), count)
    cuts = sorted(rng.sample(range(1, count), rng.randint(0, count - 1)))
    return [numbers[a:b] for a, b in zip([0, *cuts], [*cuts, count], strict=True)]


def _agent(
    rng: random.Random, ids: list[int], names: Names, known: list[str], v: list[str], rational: list[str]
) -> tuple[str, list[str]]:
    order = rng.choice([1, 1, 2, 3])
    z = [names.new(INITIAL) for _ in range(rng.choice([0, 1, 2, 3]))]
    own = _constants(rng, names, known, rng.choice([0, 0, 1, 2]))
    numbers = Numbers(rng, [*rational, "id"])
    w = [names.new() for _ in range(rng.randint(0, 3))]
    chain, known = [f"x{k}" for k in range(1, order + 1)], [*known, *own]

    def expression(*symbols: str) -> str:
        return _text(_expression(rng, [*symbols, *known], DEPTH))

    shown = f'"{min(ids)}-{max(ids)}"' if ids == list(range(min(ids), max(ids) + 1)) else str(ids)
    entries = {
        "ids": shown,
        "order": str(order),
        "f": expression(*z, *chain, *v, *w),
        "b": expression(*w),
        "cost": expression("s"),
    }
    if z or rng.random() < 0.1:
        entries["zero_dynamics"] = _inline(rng, {name: expression(*z, "x1", *v, *w) for name in z})
    if own:
        entries["constants"] = _inline(rng, own)
    if w:
        entries["uncertain"] = _inline(rng, {name: numbers.interval() for name in w})
    if rng.random() < 0.3:
        entries["steady_state"] = _inline(rng, {name: expression("s", *v, *w) for name in rng.sample(z, len(z))})
    if z and rng.random() < 0.3:
        entries["zero_dynamics_lyapunov"] = expression(*z)
    if rng.random() < 0.3:
        size = rng.randint(1, 3)
        rows = ", ".join(f"[{', '.join(numbers.value() for _ in range(size))}]" for _ in range(size))
        column = ", ".join(numbers.value() for _ in range(size))
        entries["internal_model"] = f"{{ M = [{rows}], N = [{column}] }}"
    for key, size in (("gamma", order - 1), ("observer", order)):
        if rng.random() < 0.2:
            entries[key] = f"[{', '.join(numbers.value(1) for _ in range(size))}]"
    shuffled = {key: entries[key] for key in rng.sample(list(entries), len(entries))}
    return f"[[agent]]\n{_lines(rng, shuffled)}", z


def _expression(rng: random.Random, names: list[str], depth: int) -> str:
    """Defined for positive names, so that it can be compared at a positive point."""
    if depth == 0:
        return rng.choice(names) if names and rng.random() < 0.7 else rng.choice(["1", "2.5", "1/3", "1e-1"])
    inner = [_expression(rng, names, depth - 1) for _ in range(2)]
    kind = rng.randrange(8)
    if kind < 3:
        return f"{inner[0]} {'+-'[rng.randrange(2)]} ({inner[1]})"
    if kind == 3:
        return f"({inner[0]})*({inner[1]})"
    if kind == 4:
        return f"({inner[0]}){rng.choice(['^', '**'])}{rng.choice(['2', '3', '1', '(4/2)'])}"
    if kind == 5:
        return f"{rng.choice(SMOOTH)}({inner[0]})"
    if kind == 6:
        return f"({inner[0]})/(2 + ({inner[1]})^2)"
    roots = ["sqrt(2 + cos({}))", "(3 + sin({}))^(1/3)", "(3 + sin({}))^(-5/4)"]
    root = rng.choice([*roots, "log(2 + cos({}))"] if depth == DEPTH else roots)  # no logarithm inside exp
    return root.format(inner[0])


def _initial(rng: random.Random, zero_states: list[str], numbers: Numbers, lone: bool) -> str:
    """``lone``: every agent has a table of its own, so that an array of components may fit none of the others."""
    entries = {"box": numbers.interval()} if rng.random() < 0.93 else {}
    for key in ("eta", "reference"):
        if rng.random() < 0.5:
            entries[key] = numbers.interval()
    for key in ("z", "x", "observer"):
        components = sorted(set(zero_states)) if key == "z" else ["x1", "x2"][: rng.choice([1, 1, 1, 1, 2])]
        kind = rng.random()
        if kind < 0.35:
            chosen = rng.sample(components, rng.randint(0, len(components)))
            entries[key] = _inline(rng, {name: numbers.interval() for name in dict.fromkeys(chosen)})
        elif kind < 0.55:
            entries[key] = numbers.interval()
        elif kind < 0.57 and lone:
            entries[key] = f"[{', '.join(f'[{low}, {low + 2}]' for low in range(rng.randint(1, 2)))}]"
    if rng.random() < 0.1:
        entries["observer"] = '"measured"'
    shuffled = {key: entries[key] for key in rng.sample(list(entries), len(entries))}
    return f"[initial]\n{_lines(rng, shuffled)}"


def _requested(rng: random.Random, count: int, numbers: Numbers) -> list[str]:
    """The tables that ask for something, now and then one without what it needs."""
    sampled, lines = rng.random() < 0.4, []
    coordinator = {key: numbers.value(1) for key in ("alpha1", "alpha2", "gradient_gain", "mixing_gain")}
    coordinator |= {key: numbers.value(0) for key in ("mixing_time", "softening")}
    if sampled:
        coordinator["period"] = numbers.value(1)
    kinds = {
        "gains": {key: lambda: numbers.value(1) for key in SHARED_GAINS},
        "requirements": {
            "settling": lambda: f"{{ time = {numbers.value(0)}, band = {numbers.value(1)} }}",
            "input": lambda: numbers.value(1),
            "bandwidth": lambda: numbers.value(1),
            "region": lambda: '"largest"',
        },
        "implementation": {
            "delay": lambda: rng.choice([numbers.value(0), f"[0, {numbers.value(0)}]"]),
            "noise": lambda: numbers.value(0),
            "input_resolution": lambda: numbers.value(0),
            "arithmetic": lambda: rng.choice(['"double"', '"single"']),
        },
    }
    if rng.random() < 0.5:
        chosen = rng.sample(list(coordinator), rng.randint(0, len(coordinator)))
        lines.append(f"[coordinator]\n{_lines(rng, {key: coordinator[key] for key in chosen})}")
    for table, makers in kinds.items():
        if table == "implementation" and not sampled:
            continue
        for number in [0, *rng.sample(range(1, count + 1), rng.randint(0, count))]:
            chosen = rng.sample(list(makers), rng.randint(0, len(makers)))
            entries = {key: makers[key]() for key in chosen}
            if table == "implementation" and (not number or rng.random() < 0.1) and rng.random() < 0.98:
                entries["period"] = numbers.value(1)
            if number or entries or table == "implementation":
                lines.append(f"[{table}{f'.{number}' if number else ''}]\n{_lines(rng, entries)}")
    return lines
