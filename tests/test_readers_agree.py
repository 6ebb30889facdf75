"""The two plant readers share no code and must understand the same file: quirks of TOML, names, boxes, numbers."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest
from fuzz.agreement import difference

from certify.checker.plant import read_plant
from certify.checker.verdict import Malformed
from symbolic.errors import InputError
from symbolic.plant_file import parse_plant

PLANTS = Path(__file__).parent / "tamper" / "plants"
LONE, SECOND, PAIR = (
    (PLANTS / f"small_{name}.toml").read_text() for name in ("first_order", "second_order", "two_agents")
)
BOX, F, B, COST = "box = [-1, 1]", '"p*x1"', 'b = "1"', '"(s - 1)^2/2"'
INITIAL = [
    f"{BOX}\nz = [-1,]",
    f'{BOX}\nz = "q"',
    f"{BOX}\nz = {{}}",
    f"{BOX}\nz = {{z9 = 1}}",
    f"{BOX}\nz = {{z1 = 2}}",
    f"{BOX}\nz = []",
    f"{BOX}\nz = {{z1 = [0, 1], z2 = [[0, 1]]}}",
    f"{BOX}\nx = [1]",
    f"{BOX}\nx = [1, 2]",
    f"{BOX}\nx = [[1, 2]]",
    f"{BOX}\nx = [[1, 2], [1, 3]]",
    f"{BOX}\nx = [[1, 2], [1, 3], [1, 3]]",
    f"{BOX}\nx = {{x01 = 1}}",
    f'{BOX}\nz = [[0, 1], "id"]',
    f'{BOX}\nz = "id"',
    f"{BOX}\nbox = 3",
    "box = [2, 1]\nx = [0, 1]\nz = [0, 1]",
    'box = "w"',
    "box = {z1 = 1}",
    'box = ["-id", "id"]',
    'box = ["-1", "1"]',
    "box = [-1.0, 1e0]",
    "box = [-1, 1, 1]",
    "box = [-1]",
    "box = true",
    "box = 1979-05-27",
    "box = inf",
    "box = [-0.0, 0x10]",
    "box = [-1, 1_0]",
    "box = [-1, +1]",
    'box = ["-sqrt(2)", 1]',
    'box = ["-sqrt(4)", "sqrt(9/4)"]',
    "x = 1\nz = 1",
    "x = {x1 = 1}\nz = 1",
    "x = {x1 = 1}\nz = 1\nbox = {}",
]


def agree(text: str) -> str:
    """``accepted`` or ``refused``, which both readers say, and of the same plant."""
    outcomes = []
    for reader, refusal in ((read_plant, Malformed), (lambda data: parse_plant(data, "x.toml"), InputError)):
        try:
            outcomes.append(("accepted", reader(text.encode("utf-8", "surrogatepass"))))  # type: ignore[operator]
        except refusal as reason:
            outcomes.append(("refused", str(reason)))
    assert difference(outcomes[0], outcomes[1]) is None, outcomes
    return outcomes[0][0]


def edited(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new, 1)


@pytest.mark.parametrize("plant", [LONE, SECOND, PAIR], ids=["lone", "second", "pair"])
@pytest.mark.parametrize("initial", INITIAL)
def test_boxes_of_the_initial_set(plant: str, initial: str) -> None:
    agree(edited(plant, BOX, initial))


ACCEPTED = [
    ("name", 'name = "one first-order agent"', 'name = "Änderung → ∞ 𝒙"'),
    ("literal string", COST, "'(s - 1)^2/2'"),
    ("lines in a string", COST, '"""\n(s - 1)^2\n/ 2"""'),
    ("escape in a string", COST, '"(s - 1)\\u005e2/2"'),
    ("power", COST, '"(s - 1)**2/2"'),
    ("sign before a power", COST, '"-(1 - s)^2/2 + (1 - s)^2"'),
    ("powers from the right", F, '"2^3^2*p*x1"'),
    ("sign in an exponent", F, '"2^-3*p*x1"'),
    ("signs in a row", F, '"--+-p*x1"'),
    ("division from the left", F, '"p*x1/2/3"'),
    ("product after division", F, '"p/2*x1"'),
    ("exponent in a number", F, '"1e-3*p*x1 + 5.e1*x1 + .5*x1"'),
    ("name that looks like an exponent", F, '"2*e1*x1*p"\nconstants = { e1 = 3 }'),
    ("dotted table", BOX, 'box = [-1, 1]\nx.x1 = "1/2"'),
    ("quoted key", 'cost = "(s', '"cost" = "(s'),
    ("edge with blanks", "edges = []", "edges = []  # 1 -> 1"),
    ("ids as a range", "ids = [1]", 'ids = "1-1"'),
    ("ids as a range of dots", "ids = [1]", 'ids = ["1..1"]'),
    ("carriage returns", "\n", "\r\n"),
    ("number for an expression", F, "0"),
    ("decimal is not binary", F, '"0.1*x1*p"'),
    ("longest integer", F, '"' + "9" * 1000 + '*p*x1"'),
    ("plus sign and zeros in an exponent", F, '"1e+000001*p*x1"'),
    ("many parentheses", F, '"' + "+".join(["((p))*(x1)"] * 499) + '"'),
    ("64 parameters", "uncertain = { ", f"uncertain = {{ {', '.join(f'q{k} = 0' for k in range(63))}, "),
    ("square root as an exponent", F, '"(2 + p)^(1/2)*x1"'),
    ("other rational exponents", F, '"(2 + p)^(-3/4)*x1 + (2 + p)^(5/3)*x1 + 8^(1/3)*x1"'),
    ("decimal exponent", F, '"(2 + p)^1.5*x1"'),
    ("pi", F, '"pi*p*x1"'),
    ("box with a root", BOX, 'box = [-1, "8^(1/3)"]'),
    ("name with an underscore", B, B + "\nconstants = { p_ = 1 }"),
]
REFUSED = [
    ("key twice", B, 'b = "1"\nb = "2"'),
    ("key twice, once quoted", B, 'b = "1"\n"b" = "2"'),
    ("unknown key", B, 'b = "1"\nB = "1"'),
    ("key of another alphabet", B, 'b = "1"\n"с" = "1"'),
    ("two tables", "[initial]", "[initial]\nbox = 1\n[initial]"),
    ("one table for all agents", "[[agent]]", "[agent]"),
    ("full-width digits", "ids = [1]", 'ids = "１-１"'),
    ("arabic digits", COST, '"(s - ١)^2/2"'),
    ("superscript", COST, '"(s - 1)²/2"'),
    ("minus sign", COST, '"(s \u2212 1)^2/2"'),
    ("no-break space", COST, '"(s\u00a0- 1)^2/2"'),
    ("form feed", COST, '"(s\\f- 1)^2/2"'),
    ("zero-width space", COST, '"(s\u200b - 1)^2/2"'),
    ("cyrillic s", COST, '"(ѕ - 1)^2/2"'),
    ("mathematical s", COST, '"(𝑠 - 1)^2/2"'),
    ("nul", COST, '"(s - 1)^2/2\\u0000"'),
    ("implicit product", F, '"2p*x1"'),
    ("implicit product of brackets", F, '"(p)(x1)"'),
    ("state as a function", F, '"x1(p)"'),
    ("function without argument", F, '"sin*x1"'),
    ("function with two", F, '"sin(p, x1)"'),
    ("exponent not constant", F, '"p^x1"'),
    ("exponent not rational", F, '"p^sqrt(2)*x1"'),
    ("exponent whose denominator is too large", F, '"p^(1/65)*x1"'),
    ("pi as a parameter", "p = [-1", "pi = [-1"),
    ("rational by more than fractions", BOX, 'box = ["-1", "sqrt(2)^2"]'),
    ("exponent too large", F, '"p^65*x1"'),
    ("exponent of 10^400", F, '"1e401*x1"'),
    ("exponent of many digits", F, '"1e0000000001*x1"'),
    ("other state", F, '"p*x2"'),
    ("s in f", F, '"p*s"'),
    ("id as a parameter", "p = [-1", "id = [-1"),
    ("s as a parameter", "p = [-1", "s = [-1"),
    ("x1 as a parameter", "p = [-1", "x1 = [-1"),
    ("x7 as a parameter", "p = [-1", "x7 = [-1"),
    ("sin as a parameter", "p = [-1", "sin = [-1"),
    ("parameter also a constant", "[initial]", "[constants]\np = 1\n[initial]"),
    ("hexadecimal", F, '"0x10*x1*p"'),
    ("underscore in a number", F, '"1_0*x1*p"'),
    ("comment in an expression", F, '"p*x1 # 1"'),
    ("Lyapunov function without zero dynamics", B, B + '\nzero_dynamics_lyapunov = "1"'),
    ("empty internal model", B, B + "\ninternal_model = { M = [], N = [] }"),
    ("1001 agents", "agents = 1", "agents = 1001"),
    ("17 zero states", "order = 1", f"order = 1\nzero_dynamics = {{ {', '.join(f'q{k} = 0' for k in range(17))} }}"),
    ("201 constants", B, f"{B}\nconstants = {{ {', '.join(f'q{k} = 0' for k in range(201))} }}"),
    ("order 0", "order = 1", "order = 0"),
    ("order 17", "order = 1", "order = 17"),
    ("order true", "order = 1", "order = true"),
    ("order 1.0", "order = 1", "order = 1.0"),
    ("agent 0", "ids = [1]", "ids = [0]"),
    ("agent twice", "ids = [1]", "ids = [1, 1]"),
    ("no agents", "agents = 1", "agents = 0"),
    ("edge to itself", "edges = []", 'edges = ["1 -> 1"]'),
    ("box of nan", BOX, "box = nan"),
    ("box of minus infinity", BOX, "box = [-inf, 1]"),
    ("name of two lines", 'name = "one first-order agent"', 'name = "a\\nb"'),
    ("name of blanks", 'name = "one first-order agent"', 'name = "  "'),
    ("schema with a blank", "consensus-plant/1", "consensus-plant/1 "),
    ("negative gain", "[initial]", "[gains]\nK = -1\n[initial]"),
    ("gain 0", "[initial]", "[gains]\nK = 0\n[initial]"),
    ("byte order mark", 'schema = "', '\ufeffschema = "'),
]


NAMES_LIKE_KEYS = (
    "box",
    "z",
    "x",
    "eta",
    "observer",
    "reference",
    "initial",
    "K",
    "M",
    "time",
    "period",
    "agents",
    "v1",
)


@pytest.mark.parametrize("name", NAMES_LIKE_KEYS)
def test_a_name_is_never_a_key(name: str) -> None:
    """A zero state called ``box`` is no default for the others; nor is any other name a key of the table it is in."""
    text = edited(LONE, BOX, f"box = [-2, 2]\nz = {{ {name} = [-0.1, 0.1] }}")
    text = edited(text, "order = 1", f'order = 1\nzero_dynamics = {{ {name} = "x1 - {name}", z9 = "x1 - z9" }}')
    assert agree(text) == "accepted"
    ends = (Fraction(-1, 10), Fraction(1, 10)), (-2, 2)
    assert read_plant(text.encode()).agents[0].z_box == ends
    initial = parse_plant(text.encode(), "x.toml").agents[0].initial
    assert tuple((interval.lo, interval.hi) for interval in initial.z) == ends


def test_an_agents_own_constants_are_not_known_in_initial() -> None:
    text = edited(LONE, B, B + "\nconstants = { a1 = 2 }")
    assert agree(edited(text, BOX, 'box = ["-a1", "a1"]')) == "refused"
    assert (
        agree(edited(LONE, "[initial]", "[constants]\na1 = 2\n[initial]").replace(BOX, 'box = ["-a1", "a1"]'))
        == "accepted"
    )


@pytest.mark.parametrize(("old", "new"), [pytest.param(*case[1:], id=case[0]) for case in ACCEPTED])
def test_quirks_that_both_understand_alike(old: str, new: str) -> None:
    assert agree(LONE.replace(old, new) if old == "\n" else edited(LONE, old, new)) == "accepted"


@pytest.mark.parametrize(("old", "new"), [pytest.param(*case[1:], id=case[0]) for case in REFUSED])
def test_quirks_that_both_refuse(old: str, new: str) -> None:
    assert agree(edited(LONE, old, new)) == "refused"
