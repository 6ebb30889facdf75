"""Plant files: each rule with what it refuses, naming file, key and reason, and the bounds on size and work."""

from __future__ import annotations

from pathlib import Path

import pytest
from counted import at_most
from plant_texts import BASE, LONE, changed, read, refusal

from symbolic.errors import InputError
from symbolic.plant_file import load_plant
from symbolic.tables import MAX_FILE_BYTES

REFUSED = [
    ('schema = "consensus-plant/1"', 'schema = "consensus-plant/2"', "schema: this version reads 'consensus-plant/1'"),
    ('schema = "consensus-plant/1"', "", 'schema: missing; for example schema = "consensus-plant/1"'),
    ('schema = "consensus-plant/1"', "schema = 1", "schema: this version reads"),
    ('name = "two"', "", "name: missing"),
    ('name = "two"', "name = 2", "name: a string is needed, found an integer"),
    ('name = "two"', r'name = "a\nb"', "name: a line of 1 to 200 printable characters is needed"),
    ('name = "two"', 'name = "two"\nplants = 3', "unknown key 'plants'; known keys: schema, name, network"),
    ("[coordinator]", "[cordinator]", "unknown key 'cordinator'; did you mean 'coordinator'?"),
    ("agents = 2", "agents = 0", "network.agents: an integer from 1 to 1000 is needed"),
    ("agents = 2", "agents = 1001", "network.agents: an integer from 1 to 1000 is needed"),
    ("agents = 2", "agents = true", "network.agents: an integer is needed, found a boolean"),
    ("agents = 2", "agents = 2.0", "network.agents: an integer is needed, found a decimal number"),
    ("agents = 2", "agents = 3", "agent: agent 3 has no [[agent]] table"),
    ("agents = 2", "agents = 9", "agent: agents 3, 4, 5, 6, 7... have no [[agent]] table"),
    ("agents = 2", "agent = 2", "network: unknown key 'agent'; did you mean 'agents'?"),
    ('"1 -> 2", [', '"1 => 2", [', "network.edges[1]: an edge is written \"j -> i\", found '1 => 2'"),
    ('"1 -> 2", [', '"1 -> 3", [', "network.edges[1]: there is no agent 3; agents are 1 to 2"),
    ('"1 -> 2", [', '"0 -> 2", [', "network.edges[1]: there is no agent 0; agents are 1 to 2"),
    ('"1 -> 2", [', '"2 -> 2", [', "network.edges[1]: agent 2 cannot hear itself"),
    ('"1 -> 2", [', '"1 -> 2", "1 -> 2", [', "network.edges[2]: the edge 1 -> 2 is given twice"),
    ('"1 -> 2", [', "12, [", 'network.edges[1]: an edge is "j -> i" or ["j -> i", weight]'),
    ('"1 -> 2", [', '["1 -> 2", 1, 1], [', 'network.edges[1]: an edge is "j -> i" or ["j -> i", weight]'),
    ('"2 -> 1", 0.1', '"2 -> 1", 0', "network.edges[2]: a weight is positive, found 0"),
    ('"2 -> 1", 0.1', '"2 -> 1", -0.1', "network.edges[2]: a weight is positive, found -1/10"),
    ('"2 -> 1", 0.1', '"2 -> 1", "sqrt(2)"', "network.edges[2]: a rational number is needed, 'sqrt(2)' is not"),
    ('"2 -> 1", 0.1', '"2 -> 1", inf', "network.edges[2]: a finite number is needed, found inf"),
    ('["1 -> 2", ["2 -> 1", 0.1]]', '"1 -> 2"', "network.edges: an array is needed, found a string"),
    ('theta = "4/5"', 'theta = "4/5 + beta"', "constants.theta: column 7: unknown name 'beta'"),
    ('theta = "4/5"', 'theta = "A"', "constants.theta: column 1: 'A' is declared further down"),
    ('theta = "4/5"', 'theta = "log(0)"', "constants.theta: column 1: log of this argument is not"),
    ('theta = "4/5"', 'theta = "1/(A1 - 11)"', "constants.theta: column 4: 'A1' is declared further down"),
    ('theta = "4/5"', "theta = nan", "constants.theta: a finite number is needed, found nan"),
    ('theta = "4/5"', "theta = false", "constants.theta: a number or a string with an"),
    ('theta = "4/5"', "theta = 1979-05-27", "found a date or time"),
    ('theta = "4/5"', "theta = { a = 1 }", "found a table"),
    ("A = 10", "x2 = 10", "constants.x2: the name 'x2' is taken: x1, x2, ... are the states of the chain"),
    ("A = 10", "s = 10", "constants.s: the name 's' is taken: it is the cost variable"),
    ("A = 10", "id = 10", "constants.id: the name 'id' is taken: it is the agent's number"),
    ("A = 10", "sin = 10", "constants.sin: the name 'sin' is taken: it is a function"),
    ("A = 10", '"a b" = 10', "constants.a b: 'a b' is not a name"),
    ("A = 10", '"_a" = 10', "constants._a: '_a' is not a name"),
    ("A = 10", '"µ" = 10', r"'\xb5' is not a name"),
    ('["v1", "v2"]', '["v1", "v1"]', "exosystem.states[2]: the name 'v1' is taken: it is an exosystem state"),
    ('["v1", "v2"]', '["v1", "A"]', "exosystem.states[2]: the name 'A' is taken: it is a constant"),
    ('["v1", "v2"]', '["v1", 2]', "exosystem.states[2]: a name is needed, found an integer"),
    ('["v1", "v2"]', '["v1"]', "exosystem.S: a 1 by 1 matrix is needed"),
    ('[[0, "theta"], ["-theta", 0]]', '[[0, "theta"]]', "exosystem.S: a 2 by 2 matrix is needed"),
    ('[[0, "theta"], ["-theta", 0]]', "[[0, 1], 2]", "exosystem.S[2]: an array is needed, found an integer"),
    ('[[0, "theta"], ["-theta", 0]]', '[[0, "v1"], [0, 0]]', "exosystem.S[1][2]: column 1: unknown name 'v1'"),
    ("v2 = [0.5, 1]", "v2 = [1, 0.5]", "exosystem.initial.v2: the interval [1, 1/2] is empty"),
    ("v2 = [0.5, 1]", "v2 = [1]", "exosystem.initial.v2: an interval is a pair [lo, hi] of numbers"),
    (", v2 = [0.5, 1]", "", "exosystem.initial.v2: missing"),
    ("v2 = [0.5, 1]", "v2 = 0, v3 = 1", "exosystem.initial: unknown key 'v3'; did you mean 'v"),
    ("box = [-1, 1]", "", "initial.z: missing, and there is no initial.box to stand for it"),
    ("box = [-1, 1]", "box = [1, -1]", "initial.box: the interval [1, -1] is empty"),
    ("box = [-1, 1]", "box = 1\nx = [[1, 1], [1, 1], [1, 1]]", "initial.x: one interval for each of x1, x2 is"),
    ("box = [-1, 1]", "box = 1\nx = [1, [1, 1]]", "initial.x[1]: an interval is a pair [lo, hi]; write [1, 1]"),
    ("box = [-1, 1]", "box = 1\nx = { x3 = 1 }", "initial.x: no agent has a state 'x3'"),
    (
        "box = [-1, 1]",
        "box = 1\nz = { z1 = 'A1*k' }",
        "initial.z.z1: column 4: 'k' is a constant of one [[agent]] table",
    ),
    ("box = [-1, 1]", 'box = 1\nobserver = "exact"', "initial.observer: column 1: unknown name 'exact'"),
    ("box = [-1, 1]", "box = 1\nzeta = 0", "initial: unknown key 'zeta'; did you mean 'eta'?"),
    ("reference = 0", "reference = { x1 = 0 }", "initial.reference: a number or a string with an expression is needed"),
    ("[[agent]]", "[agent]", "agent: agents are given as [[agent]] tables, with two brackets"),
    ("ids = [1, 2]", "", "agent[1].ids: missing; for example ids = [1, 2]"),
    ("box = [-1, 1]", 'box = [-1, 1]\nobserver = "mesured"', "unknown word 'mesured'; did you mean \"measured\"?"),
    ("ids = [1, 2]", "ids = [1]", "agent: agent 2 has no [[agent]] table"),
    ("ids = [1, 2]", "ids = [1, 2, 1]", "agent[1].ids: 3 entries, more than 2"),
    ("ids = [1, 2]", "ids = [1, 1]", "agent[1].ids: agent 1 is described twice"),
    ("ids = [1, 2]", "ids = [0, 1]", "agent[1].ids[1]: an integer from 1 to 2 is needed"),
    ("ids = [1, 2]", "ids = []", "agent[1].ids: at least one agent is needed"),
    ("ids = [1, 2]", 'ids = "1-3"', "agent[1].ids: a range of agents from 1 to 2 is needed, found '1-3'"),
    ("ids = [1, 2]", 'ids = "2-1"', "agent[1].ids: a range of agents from 1 to 2 is needed, found '2-1'"),
    ("ids = [1, 2]", 'ids = ["a"]', "agent[1].ids[1]: a range is written \"3-5\", found 'a'"),
    ("ids = [1, 2]", "ids = 1", "agent[1].ids: an array is needed, found an integer"),
    ("ids = [1, 2]", "id = [1, 2]", "agent[1]: unknown key 'id'; did you mean 'ids'?"),
    ("order = 2", "order = 17", "agent[1].order: an integer from 1 to 16 is needed"),
    ("order = 2", "order = 0", "agent[1].order: an integer from 1 to 16 is needed"),
    ("order = 2", "order = 1", "agent[1].f: column 10: 'x2' may not appear here: order = 1, so the states are x1"),
    ("order = 2", "ordr = 2", "agent[1]: unknown key 'ordr'; did you mean 'order'?"),
    (
        '{ z1 = "p1*z1 + x1 + A1*v1" }',
        '{ z1 = "p1*z1 + x2" }',
        "agent[1].zero_dynamics.z1: column 9: 'x2' may not appear here: in the normal form the zero dynamics depend on",
    ),
    ('{ z1 = "p1*z1 + x1 + A1*v1" }', '{ z1 = "p1*z1 + s" }', "zero_dynamics.z1: column 9: 's' may not appear here"),
    ('{ z1 = "p1*z1 + x1 + A1*v1" }', '{ v1 = "z1" }', "agent[1].zero_dynamics.v1: the name 'v1' is taken"),
    ('{ z1 = "p1*z1 + x1 + A1*v1" }', '{ z1 = ["x1"] }', "a string with an expression is needed, found an array"),
    ('"p2*z1*x1*x2 + k*x2 + A*v2"', '"p2*z1*x1*x2 + k*x2 + A*v3"', "agent[1].f: column 24: unknown name 'v3'; did you"),
    ('"p2*z1*x1*x2 + k*x2 + A*v2"', '"x2 + s"', "agent[1].f: column 6: 's' may not appear here: f depends"),
    (
        '"p2*z1*x1*x2 + k*x2 + A*v2"',
        '"x2 + u"',
        "agent[1].f: column 6: 'u' may not appear here: the input enters as b*u",
    ),
    ('"p2*z1*x1*x2 + k*x2 + A*v2"', "\"__import__('os').system('x')\"", "agent[1].f: column 1: unexpected character"),
    ('"p2*z1*x1*x2 + k*x2 + A*v2"', '"x2**x1"', "agent[1].f: column 5: an exponent must be a rational constant"),
    ('"p2*z1*x1*x2 + k*x2 + A*v2"', "true", "agent[1].f: a number or a string with an expression is needed"),
    ('"1 + p2^2"', '"1 + x1^2"', "agent[1].b: column 5: 'x1' may not appear here: b depends on the parameters only"),
    ('"1 + p2^2"', '"1 + v1"', "agent[1].b: column 5: 'v1' may not appear here"),
    ('"(s - id + 1)^2/4"', '"(s - x1)^2"', "agent[1].cost: column 6: 'x1' may not appear here: a cost"),
    ('"(s - id + 1)^2/4"', '"p2*s^2"', "agent[1].cost: column 1: 'p2' may not appear here"),
    ('{ k = "id*A" }', '{ k = "id*B" }', "agent[1].constants.k: column 4: unknown name 'B'"),
    ('{ k = "id*A" }', "{ z1 = 1 }", "agent[1].constants.z1: the name 'z1' is taken: it is a zero state"),
    ('{ k = "id*A" }', "{ A = 1 }", "agent[1].constants.A: the name 'A' is taken: it is a constant"),
    ('{ k = "id*A" }', '{ k = "p1" }', "agent[1].constants.k: column 1: unknown name 'p1'"),
    ("p2 = [-0.5, 0.5]", "p2 = [-0.5, 0.5], k = 1", "agent[1].uncertain.k: the name 'k' is taken: it is a constant"),
    ("p2 = [-0.5, 0.5]", "p2 = [-0.5, 0.5], x1 = 1", "agent[1].uncertain.x1: the name 'x1' is taken"),
    ("p2 = [-0.5, 0.5]", "p2 = [0.5, -0.5]", "agent[1].uncertain.p2: the interval [1/2, -1/2] is empty"),
    ("p2 = [-0.5, 0.5]", 'p2 = ["-root", 0.5]', "agent[1].uncertain.p2[1]: a rational number is needed"),
    ("p2 = [-0.5, 0.5]", "p2 = [0, inf]", "agent[1].uncertain.p2[2]: a finite number is needed, found inf"),
    ("p2 = [-0.5, 0.5]", 'p2 = ["p1", 0.5]', "agent[1].uncertain.p2[1]: column 1: unknown name 'p1'"),
    ('{ z1 = "-s/p1" }', '{ z1 = "-x1/p1" }', "agent[1].steady_state.z1: column 2: 'x1' may not appear"),
    ('{ z1 = "-s/p1" }', '{ z2 = "-s/p1" }', "agent[1].steady_state: unknown key 'z2'; did you mean 'z1'?"),
    ('{ z1 = "-s/p1" }', "{ }", "agent[1].steady_state.z1: missing"),
    ('"z1^2/2"', '"z1^2/2 + v1"', "zero_dynamics_lyapunov: column 10: 'v1' may not appear here: this V0"),
    ("N = [0, 1] }", "N = [0, 1, 2] }", "agent[1].internal_model.N: 2 numbers are needed, found 3"),
    (", N = [0, 1] }", "}", "agent[1].internal_model.N: missing"),
    ("[[0, 1], [-2, -3]]", "[[0, 1], [-2]]", "agent[1].internal_model.M[2]: 2 numbers are needed, found 1"),
    ("[[0, 1], [-2, -3]]", "[]", "agent[1].internal_model.M: at least one row is needed"),
    ("[[0, 1], [-2, -3]]", '[[0, "root"], [-2, -3]]', "agent[1].internal_model.M[1][2]: a rational number is needed"),
    ('gamma = ["1/2"]', "gamma = [1, 2]", "agent[1].gamma: 1 number is needed, found 2"),
    ("observer = [1, 2]", "observer = [1]", "agent[1].observer: 2 numbers are needed, found 1"),
    ("observer = [1, 2]", 'observer = "1"', "agent[1].observer: an array is needed, found a string"),
    ("alpha1 = 3", "alpha1 = 0", "coordinator.alpha1: a positive number is needed, found 0"),
    ("alpha1 = 3", "alpha3 = 3", "coordinator: unknown key 'alpha3'; did you mean 'alpha"),
    ("K = 40000", "k = 40000", "gains: unknown key 'k'; did you mean 'K'?"),
    ("K = 40000", "K = -1", "gains.K: a positive number is needed, found -1"),
    ("K = 40000", "K = []", "gains.K: a number or a string with an expression is needed, found an array"),
    ("K = 40000", "K = 1e999", "gains.K: the number's exponent is beyond 300"),
    ("K = 40000", f"K = 0x{'f' * 2000}", "gains.K: the integer has more than 4000 bits"),
    ("K = 40000", f'K = "-{"9" * 900}"', "gains.K: a positive number is needed, found a rational number of"),
]


@pytest.mark.parametrize(("old", "new", "message"), REFUSED)
def test_refused_with_file_key_and_reason(old: str, new: str, message: str) -> None:
    assert message in refusal(changed(old, new))


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (2, "network: missing; for example network = { agents = 2, edges = ["),
        (3, "initial: missing; for example initial = { box = [-1, 1], reference = 0, observer = 0, eta = 0 }"),
        (4, "agent: missing; for example [[agent]], then ids, order, f, b and cost in lines of their own"),
    ],
)
def test_a_missing_table_is_shown_by_an_example(lines: int, message: str) -> None:
    begun = [
        'schema = "consensus-plant/1"',
        'name = "one"',
        "network = { agents = 1, edges = [] }",
        "initial = { box = 0 }",
    ]
    assert message in refusal("\n".join(begun[:lines]))


@pytest.mark.parametrize("agent", ["agent = []", "[agent]", "agent = 3", "agent = [3]", "agent = [{}]"])
def test_agents_without_a_table_are_no_plant(agent: str) -> None:
    begun = LONE[: LONE.index("[[agent]]")]
    assert "agent" in refusal(f"{agent}\n{begun}" if "=" in agent else f"{begun}{agent}")


def test_an_agent_in_two_tables() -> None:
    assert "agent[2].ids: agent 1 is described twice" in refusal(
        changed("agents = 1", "agents = 2", LONE) + LONE[LONE.index("[[agent]]") :]
    )


def test_answers_about_zero_dynamics_need_zero_dynamics() -> None:
    message = "agent[1].zero_dynamics_lyapunov: there are no zero dynamics; leave this out"
    assert refusal(LONE + 'zero_dynamics_lyapunov = "1"') == message
    assert "agent[1].steady_state: unknown key 'z1'" in refusal(LONE + 'steady_state = { z1 = "s" }')


@pytest.mark.parametrize("line", ['z = "rubbish"', "z = [[1]]", "z = [1, 0]"])
def test_an_initial_entry_that_no_agent_uses_is_read_all_the_same(line: str) -> None:
    assert refusal(changed("box = 0", f"box = 0\n{line}", LONE)).startswith("initial.z: ")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", 'schema: missing, the file is empty; begin with schema = "consensus-plant/1"'),
        (b"schema = ", "not valid TOML: Invalid value"),
        (b"a = 1\na = 2\nb = 3", "not valid TOML: Cannot overwrite a value; a key is given once"),
        (b"a = 1\nb = \xff", "the file is not UTF-8; save it as UTF-8"),
        (b"x = " + b"[" * 100_000, "the file is nested too deeply"),
        (b"x = " + b"{a = " * 100_000, "the file is nested too deeply"),
        (b"x = " + b"9" * 10_000, "not valid TOML"),
        (b".".join([b"a"] * 100_000) + b" = 1", "a dotted key has more than 32 parts"),
        (b"[" + b" . ".join([rb'"a\""'] * 100_000) + b"]", "a dotted key has more than 32 parts"),
        (b"#" * (MAX_FILE_BYTES + 1), "the file is larger than 1000000 bytes"),
    ],
)
def test_bytes_that_are_no_plant(text: bytes, message: str) -> None:
    with at_most(20_000):
        assert message in refusal(text)


def test_dots_in_comments_and_values_are_not_keys() -> None:
    assert read("#" + " ." * 100 + "\n" + BASE) != read(BASE)
    assert read(changed('name = "two"', f'name = "{"." * 100}"')).name == "." * 100


def test_an_oversized_file_is_not_read_whole(tmp_path: Path) -> None:
    large = tmp_path / "large.toml"
    with large.open("wb") as file:
        file.truncate(10**12)
    with pytest.raises(InputError, match=r"large\.toml: the file is larger than 1000000 bytes"):
        load_plant(large)


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"missing\.toml: cannot be read: No such file or directory"):
        load_plant(tmp_path / "missing.toml")
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        load_plant(tmp_path)
    with pytest.raises(InputError, match="cannot be read: embedded null byte"):
        load_plant("a\0b")
    with pytest.raises(InputError, match=r"a\\nb\.toml: cannot be read") as caught:
        load_plant(tmp_path / "a\nb.toml")
    assert str(caught.value).isprintable()


def test_a_thousand_agents_are_quick() -> None:
    text = changed("agents = 2", "agents = 1000").replace("ids = [1, 2]", 'ids = "1-1000"')
    with at_most(40_000_000):
        assert len(read(text).agents) == 1000


def test_the_work_of_all_agents_together_is_bounded() -> None:
    text = changed("agents = 2", "agents = 1000").replace("ids = [1, 2]", 'ids = "1-1000"')
    text = text.replace("(s - id + 1)^2/4", "+".join(["(s - id)^2"] * 500))
    assert (
        refusal(text)
        == "agent: the expressions of all agents together have more than 5000000 characters; name what is repeated"
    )
