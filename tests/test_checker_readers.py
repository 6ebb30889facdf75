"""The checker's two readers: exactly the files of the specification, everything else refused in one line."""

from __future__ import annotations

import hashlib
import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from certify.checker import check
from certify.checker.certificate import MAX_BYTES, read_certificate
from certify.checker.expressions import Name, Number
from certify.checker.plant import read_plant
from certify.checker.requested import Coordinator, Gains
from certify.checker.theorems import kinds
from certify.checker.verdict import Malformed
from symbolic.errors import InputError
from symbolic.plant_file import parse_plant

CORPUS = Path(__file__).parent / "checker_corpus"
EXAMPLES = Path(__file__).parent.parent / "examples"
PLANT = """
schema = "consensus-plant/1"
name = "small"
[network]
agents = 2
edges = ["1 -> 2", ["2 -> 1", "1.5"]]
[constants]
half = "1/2"
r = "sqrt(2)"
[exosystem]
states = ["v1", "v2"]
S = [[0, "half"], ["-half", 0]]
initial = { v1 = 0, v2 = [0, 1.5] }
[initial]
box = [-1, 1]
reference = 0.1
[[agent]]
ids = [1, 2]
zero_dynamics = { z1 = "-z1 + x1 + A*v1" }
order = 2
f = "id*x1 + w*x2 + r*z1"
b = 2
cost = "(s - id)^2"
constants = { A = "half*id" }
uncertain = { w = ["-half", "half"] }
"""


def test_a_plant_is_read_exactly() -> None:
    plant = read_plant(PLANT.encode())
    assert plant.sha256 == hashlib.sha256(PLANT.encode()).hexdigest()
    assert plant.laplacian == [[Fraction(3, 2), Fraction(-3, 2)], [-1, 1]]
    rotation = plant.S
    assert rotation == [[0, Fraction(1, 2)], [Fraction(-1, 2), 0]]
    assert plant.exosystem == {"v1": (0, 0), "v2": (0, Fraction(3, 2))}
    first, second = plant.agents
    assert (first.id, second.id, second.order, second.chain, second.zero_states) == (1, 2, 2, ("x1", "x2"), ("z1",))
    assert first.parameters == {"w": (Fraction(-1, 2), Fraction(1, 2))}
    assert first.reference_box == (Fraction(1, 10), Fraction(1, 10))
    assert first.x_box == first.observer_box == ((-1, 1), (-1, 1))
    assert first.b == Number(Fraction(2))
    assert (first.gamma, first.observer, first.internal_model, plant.gains_of(1)) == (None, None, None, Gains())
    assert first.zero_dynamics != second.zero_dynamics  # A = id/2
    assert Name("w") in [factor for term, _ in first.f.terms for factor, _ in getattr(term, "factors", ())]


@pytest.mark.parametrize(
    ("initial", "x", "observer", "eta"),
    [
        ("box = [-1, 1]", ((-1, 1), (-1, 1)), ((-1, 1), (-1, 1)), (-1, 1)),
        ("box = 2", ((2, 2), (2, 2)), ((2, 2), (2, 2)), (2, 2)),
        ("box = [-1, 1]\nx = 3\neta = 0", ((3, 3), (3, 3)), ((-1, 1), (-1, 1)), (0, 0)),
        ("box = [-1, 1]\nx = [[0, 1], [5, 5]]", ((0, 1), (5, 5)), ((-1, 1), (-1, 1)), (-1, 1)),
        ("box = [-1, 1]\nx = { x2 = [0, 1] }", ((-1, 1), (0, 1)), ((-1, 1), (-1, 1)), (-1, 1)),
        ('box = [-1, 1]\nobserver = "measured"', ((-1, 1), (-1, 1)), None, (-1, 1)),
        (
            'box = ["-half", "id - id + half"]',
            ((Fraction(-1, 2), Fraction(1, 2)),) * 2,
            ((Fraction(-1, 2), Fraction(1, 2)),) * 2,
            (Fraction(-1, 2), Fraction(1, 2)),
        ),
    ],
)
def test_initial_boxes(initial: str, x: object, observer: object, eta: object) -> None:
    agent = read_plant(PLANT.replace("box = [-1, 1]", initial).encode()).agents[0]
    assert (agent.x_box, agent.observer_box, agent.eta_box) == (x, observer, eta)


def test_what_the_file_fixes() -> None:
    more = PLANT.replace(
        "order = 2\n", "order = 2\ngamma = [1]\nobserver = [1, 2]\ninternal_model = { M = [[-1]], N = [1] }\n"
    )
    plant = read_plant((more + "[coordinator]\nalpha1 = 3\n[gains]\nK = 10\nh = '1e9'\n").encode())
    assert (plant.coordinator, plant.gains_of(2)) == (
        Coordinator(alpha1=Fraction(3)),
        Gains(K=Fraction(10), h=Fraction(10**9)),
    )
    assert (plant.agents[0].gamma, plant.agents[0].observer) == ((1,), (1, 2))
    assert plant.agents[0].internal_model == ([(-1,)], (1,))


@pytest.mark.parametrize("path", sorted([*EXAMPLES.glob("*.toml"), *CORPUS.glob("*.toml")]), ids=lambda path: path.stem)
def test_both_readers_of_the_project_agree(path: Path) -> None:
    """The checker's own reader and the tool's: the same numbers, names and boxes."""
    mine, theirs = read_plant(path.read_bytes()), parse_plant(path.read_bytes(), str(path))
    assert mine.sha256 == theirs.sha256
    for edge in theirs.digraph.edges:
        assert mine.laplacian[edge.target - 1][edge.source - 1] == -edge.weight
    assert list(mine.exosystem) == [state.name for state in theirs.exosystem.states]
    for one, other in zip(mine.agents, theirs.agents, strict=True):
        assert (one.id, one.order, list(one.zero_states)) == (
            other.id,
            other.order,
            [z.name for z in other.zero_states],
        )
        assert list(one.parameters.values()) == [(box.lo, box.hi) for box in other.parameter_box]
        assert list(one.x_box) == [(box.lo, box.hi) for box in other.initial.x]
        assert list(one.z_box) == [(box.lo, box.hi) for box in other.initial.z]
        assert one.eta_box == (other.initial.eta.lo, other.initial.eta.hi)
        assert one.reference_box == (other.initial.reference.lo, other.initial.reference.hi)
        assert (one.observer_box is None) == (other.initial.observer is None)


REFUSED_PLANTS = [
    ('schema = "consensus-plant/1"', 'schema = "consensus-plant/2"', "schema"),
    ('name = "small"', 'name = ""', "name"),
    ('name = "small"', 'name = "small"\nextra = 1', "unknown key 'extra'"),
    ("agents = 2", "agents = 3", "no \\[\\[agent\\]\\] table"),
    ("agents = 2", "agents = true", "integer"),
    ("agents = 2", "agents = 1000000", "integer"),
    ('"1 -> 2"', '"1 -> 1"', "edge"),
    ('"1 -> 2"', '"1 -> 3"', "edge"),
    ('"1 -> 2"', '"2 -> 1"', "edge"),
    ('"1 -> 2"', '"1 => 2"', "edge"),
    ('"1.5"', '"-1"', "edge"),
    ('"1.5"', '"0"', "edge"),
    ('"1.5"', "true", "number"),
    ('half = "1/2"', 'half = "1/0"', "division by zero"),
    ('half = "1/2"', 'half = "other"', "not known"),
    ('half = "1/2"', 'x1 = "1/2"', "taken"),
    ('half = "1/2"', 'sin = "1/2"', "taken"),
    ('half = "1/2"', 's = "1/2"', "taken"),
    ('half = "1/2"', 'id = "1/2"', "taken"),
    ('half = "1/2"', '"a b" = "1/2"', "not a name"),
    ('half = "1/2"', "half = nan", "not a number"),
    ('half = "1/2"', "half = inf", "not a number"),
    ('half = "1/2"', "half = 1e999", "digits"),
    ('["v1", "v2"]', '["v1", "v1"]', "taken"),
    ('["v1", "v2"]', '["v1"]', "array of 1"),
    ('[[0, "half"], ["-half", 0]]', '[[0, "half"]]', "array of 2"),
    ("v2 = [0, 1.5]", "v3 = [0, 1.5]", "unknown key 'v3'"),
    ("v2 = [0, 1.5]", "v2 = [1.5, 0]", "empty"),
    ("v2 = [0, 1.5]", 'v2 = [0, "r"]', "rational"),
    ("v2 = [0, 1.5]", "v2 = [0, 1, 2]", "array of 2"),
    ("box = [-1, 1]", "x = [-1, 1]", "initial.z is missing"),
    ("box = [-1, 1]", "box = [-1, 1]\nx = { x3 = 0 }", "unknown key 'x3'"),
    ("box = [-1, 1]", "box = [-1, 1]\nx = [[0, 1]]", "array of 2"),
    ("box = [-1, 1]", 'box = [-1, 1]\nobserver = "exact"', "not known"),
    ("ids = [1, 2]", "ids = [1]", "no \\[\\[agent\\]\\] table"),
    ("ids = [1, 2]", "ids = [1, 2, 2]", "ids"),
    ("ids = [1, 2]", "ids = [1, 1]", "twice"),
    ("ids = [1, 2]", "ids = [0, 1]", "integer"),
    ("ids = [1, 2]", 'ids = "2-1"', "integer"),
    ("order = 2", "order = 0", "integer"),
    ("order = 2", "order = 2.0", "integer"),
    ("order = 2", "order = 17", "integer"),
    ("order = 2", "order = 2\ngamma = [1, 2]", "array of 1"),
    ("order = 2", "order = 2\nobserver = [1]", "array of 2"),
    ("order = 2", "order = 2\ninternal_model = { M = [[1, 2]], N = [1] }", "array of 1"),
    ("order = 2", "order = 2\nsteady_state = { z2 = 's' }", "unknown key 'z2'"),
    ("order = 2", "order = 2\nsteady_state = { z1 = 'x1' }", "not known"),
    ("order = 2", "order = 2\nzero_dynamics_lyapunov = 'v1'", "not known"),
    ("-z1 + x1 + A*v1", "-z1 + x2", "x2 is not known"),
    ("-z1 + x1 + A*v1", "-z1 + s", "s is not known"),
    ("id*x1 + w*x2 + r*z1", "x3", "x3 is not known"),
    ("id*x1 + w*x2 + r*z1", "x1.real", "unexpected character"),
    ("b = 2", "b = 'x1'", "x1 is not known"),
    ("b = 2", "b = 'v1'", "v1 is not known"),
    ("(s - id)^2", "(s - w)^2", "w is not known"),
    ("(s - id)^2", "(s - id)^id^2^3^4", "exponent"),
    ("uncertain = { w = ", "uncertain = { w = 1, A = ", "taken"),
    ("uncertain = { w = ", "uncertain = { w = 1, x2 = ", "taken"),
    ("constants = { A = ", "constants = { half = ", "taken"),
    ("\nf = ", "\ng = ", "unknown key 'g'"),
    ("[network]", "[network", "not TOML"),
    ("[initial]", "a = " + "[" * 5_000, "not TOML"),
    ("half = ", "half = " + "9" * 6_000 + "\nother = ", "TOML|needed"),
    ("half = ", "a" + ".a" * 40 + " = ", "too large"),
]


@pytest.mark.parametrize(("old", "new", "reason"), REFUSED_PLANTS)
def test_what_is_no_plant_is_refused(old: str, new: str, reason: str) -> None:
    assert old in PLANT
    with pytest.raises(Malformed, match=reason) as caught:
        read_plant(PLANT.replace(old, new, 1).encode())
    assert len(str(caught.value)) < 1_000


@pytest.mark.parametrize(("old", "new", "reason"), REFUSED_PLANTS)
def test_the_tool_refuses_them_too(old: str, new: str, reason: str) -> None:
    """What the checker refuses is no plant for the tool either: its reader is no stricter without need."""
    with pytest.raises(InputError):
        parse_plant(PLANT.replace(old, new, 1).encode(), "plant")


def test_gains_are_positive() -> None:
    with pytest.raises(Malformed, match="K is positive"):
        read_plant((PLANT + "[gains]\nK = 0\n").encode())


def test_large_plants_are_refused_unread() -> None:
    with pytest.raises(Malformed, match="too large"):
        read_plant(PLANT.encode() + b"#" * 1_000_000)


def certificate() -> Any:
    return json.loads((CORPUS / "first_order.json").read_bytes())


def encode(value: Any, **options: Any) -> bytes:
    return (json.dumps(value, **{"sort_keys": True, "separators": (",", ":"), **options}) + "\n").encode()


def test_a_certificate_is_read_exactly() -> None:
    found = read_certificate(encode(certificate()), kinds())
    assert found.claim.agents[0].id == 1 and found.claim.agents[0].h is None
    assert found.witness.coordinator.steps == int(certificate()["witness"]["coordinator"]["steps"])
    assert found.claim_sha256 == hashlib.sha256(encode(certificate()["claim"])[:-1]).hexdigest()


def put(path: str, value: Any) -> Any:
    copy = certificate()
    *steps, last = (int(step) if step.isdigit() else step for step in path.split("."))
    place = copy
    for step in steps:
        place = place[step]
    if value is None and last not in ("h", "exosystem"):
        del place[last]
    else:
        place[last] = value
    return copy


REFUSED_CERTIFICATES: list[tuple[bytes, str]] = [
    (b"", "not JSON"),
    (b"\n", "not JSON"),
    (b"[]\n", "keys"),
    (b"null\n", "keys"),
    (b"{}\n", "keys"),
    (b'"x"\n', "keys"),
    (b"1\n", "a number is a string"),
    (b"NaN\n", "a number is a string"),
    (b"[" * 100_000, "not JSON"),
    (b"\xff\n", "ASCII"),
    (b"true\n", "keys"),
    (b'{"a":"1","a":"1"}\n', "canonical"),
    (b" {}\n", "canonical"),
    (b"{}", "canonical"),
    (b"{}\n\n", "canonical"),
    (encode(certificate(), indent=1), "canonical"),
    (encode(dict(reversed(certificate().items())), sort_keys=False), "canonical"),
    (encode(certificate()) + b"#", "not JSON"),
    (encode(certificate())[:-5], "not JSON"),
    *[
        (encode(put(path, value)), reason)
        for path, value, reason in [
            ("schema", "consensus-certificate/2", "this checker reads"),
            ("theorem", "recipe/1", "this checker reads"),
            ("theorem", None, "keys"),
            ("producer", [], "producer"),
            ("producer", {str(k): "" for k in range(33)}, "producer"),
            ("producer", {"a": ["b"]}, "string"),
            ("claim.extra", "1", "keys"),
            ("witness.extra", "1", "keys"),
            ("claim.agents.0.extra", "1", "keys"),
            ("claim.agents.0.K", None, "keys"),
            ("witness.agents.0.a0", None, "keys"),
            ("claim.alpha1", "5/1", "lowest terms"),
            ("claim.alpha1", "10/4", "lowest terms"),
            ("claim.alpha1", "0/3", "lowest terms"),
            ("claim.alpha1", "-0", "p or p/q"),
            ("claim.alpha1", "+5", "p or p/q"),
            ("claim.alpha1", "05", "p or p/q"),
            ("claim.alpha1", "5.0", "p or p/q"),
            ("claim.alpha1", "5e0", "p or p/q"),
            ("claim.alpha1", "1/-5", "p or p/q"),
            ("claim.alpha1", "1/0", "p or p/q"),
            ("claim.alpha1", " 5", "p or p/q"),
            ("claim.alpha1", "5\n", "p or p/q"),
            ("claim.alpha1", "\u0665", "p or p/q"),
            ("claim.alpha1", "1_0", "p or p/q"),
            ("claim.alpha1", "nan", "p or p/q"),
            ("claim.alpha1", "9" * 5_000, "p or p/q"),
            ("claim.alpha1", "9" * 20_000, "string"),
            ("claim.alpha1", True, "string"),
            ("claim.alpha1", ["5"], "string"),
            ("claim.agents", {}, "list"),
            ("claim.agents.0.gamma", "1", "list"),
            ("claim.agents.0.M", ["1"], "list"),
            ("witness.coordinator.P", [["1", "2"], ["1"]], "differ in length"),
            ("witness.coordinator.P", [["0"]] * 2_100, "list of at most"),
            ("witness.coordinator.steps", "1/2", "integer"),
            ("witness.coordinator.steps", "0", "integer"),
            ("witness.coordinator.steps", "10000000", "integer"),
            ("claim.agents.0.id", "0", "integer"),
            ("witness.exosystem", {"Q": [], "R": []}, "keys"),
            ("witness.exosystem", [], "keys"),
        ]
    ],
]


@pytest.mark.parametrize(("data", "reason"), REFUSED_CERTIFICATES)
def test_what_is_no_certificate_is_refused(data: bytes, reason: str) -> None:
    with pytest.raises(Malformed, match=reason) as caught:
        read_certificate(data, kinds())
    assert len(str(caught.value)) < 1_000


def test_large_certificates_are_refused_unread() -> None:
    with pytest.raises(Malformed, match="too large"):
        read_certificate(b"[" * MAX_BYTES + b"]", kinds())


MISFITS: list[tuple[str, Any]] = [
    ("claim.agents", []),
    ("witness.agents", []),
    ("claim.agents", certificate()["claim"]["agents"][:2]),
    ("claim.agents", certificate()["claim"]["agents"][::-1]),
    ("witness.agents", certificate()["witness"]["agents"][::-1]),
    ("claim.agents", [certificate()["claim"]["agents"][0]] * 3),
    ("claim.agents.0.id", "2"),
    ("witness.agents.0.id", "2"),
    ("claim.agents.0.gamma", ["1"]),
    ("claim.agents.0.observer", ["1"]),
    ("claim.agents.0.h", "1"),
    ("claim.agents.0.M", [["1", "1"]]),
    ("claim.agents.0.N", ["1", "1"]),
    ("claim.agents.0.psi", []),
    ("witness.agents.0.ell", []),
    ("witness.agents.0.ell", ["0", "0"]),
    ("witness.agents.0.V0", [["1"]]),
    ("witness.agents.0.P1", [["1"]]),
    ("witness.agents.0.P2", []),
    ("witness.agents.0.P3", [["1"]]),
    ("witness.agents.0.steady_state", ["s"]),
    ("witness.exosystem", {"Q": [["1"]]}),
    ("witness.optimum", ["1"]),
    ("witness.coordinator.P", [["1"]]),
    ("witness.coordinator.multiplier", ["1"]),
]


@pytest.mark.parametrize(("path", "value"), MISFITS)
def test_a_certificate_of_another_shape_is_malformed(path: str, value: Any) -> None:
    verdict = check((CORPUS / "first_order.toml").read_bytes(), encode(put(path, value)))
    assert verdict.status == "malformed", verdict


@pytest.mark.parametrize("text", ["s +", "x1", "z1", "w2", "__class__", "s if s else s", "s" * 11_000])
def test_a_steady_state_that_is_no_expression_is_malformed(text: str) -> None:
    plant, data = ((CORPUS / f"mixed.{kind}").read_bytes() for kind in ("toml", "json"))
    value = json.loads(data)
    value["witness"]["agents"][0]["steady_state"] = [text]
    assert check(plant, encode(value)).status == "malformed"


@given(st.data())
@settings(max_examples=150)
def test_damaged_files_end_in_a_verdict(data: st.DataObject) -> None:
    """Bytes replaced, removed or inserted anywhere: never verified, never an exception."""
    files = [(CORPUS / f"first_order.{kind}").read_bytes() for kind in ("toml", "json")]
    which = data.draw(st.integers(0, 1))
    at = data.draw(st.integers(0, len(files[which]) - 1))
    length, insert = data.draw(st.integers(0, 3)), data.draw(st.binary(max_size=3))
    damaged = files[which][:at] + insert + files[which][at + length :]
    if damaged != files[which]:
        files[which] = damaged
        assert check(files[0], files[1], steps=300_000).status in ("rejected", "malformed")


@given(st.binary(max_size=300), st.binary(max_size=300))
def test_noise_is_malformed(plant: bytes, data: bytes) -> None:
    assert check(plant, data).status == "malformed"
