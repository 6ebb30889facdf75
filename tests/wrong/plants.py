"""Plant files with one mistake each, and the words by which its message says what to change.

``WRONG``: as people make them, written from the page of the plant file and not from the readers. ``LIMITS``: what it
takes to meet the other messages. ``docs/messages.md`` is made from both.
"""

from __future__ import annotations

from dataclasses import dataclass

PLANT = """schema = "consensus-plant/1"
name = "two carts"

[network]
agents = 2
edges = ["1 -> 2", "2 -> 1"]

[constants]
m = "3/2"
k = "2*m"

[exosystem]
states = ["v1", "v2"]
S = [[0, 1], [-1, 0]]
initial = { v1 = 0, v2 = [-1, 1] }

[initial]
box = [-1, 1]
reference = 0
observer = 0
eta = 0

[[agent]]
ids = [1, 2]
zero_dynamics = { z1 = "-z1 + x1" }
order = 2
f = "-k*x1 + p*x2 + z1 + v1"
b = "1/m"
cost = "(s - id)^2"
uncertain = { p = [-1, 1] }
"""


@dataclass(frozen=True)
class Wrong:
    """What a user did, as an edit of ``PLANT`` (or the bytes of the whole file), and the words that help."""

    title: str
    old: str
    new: str
    help: str
    data: bytes = b""

    @property
    def file(self) -> bytes:
        if not self.old:
            return self.data
        assert PLANT.count(self.old) == 1, self.title
        return PLANT.replace(self.old, self.new).encode()


def _end(lines: str) -> str:
    """Lines after the last one of ``PLANT``."""
    return f"{LAST}\n{lines}"


LAST = "uncertain = { p = [-1, 1] }"
F = "-k*x1 + p*x2 + z1 + v1"
COST = "(s - id)^2"
NEIGHBOUR = """order = 1
f = "q + z1"
b = 1
cost = "s^2"
uncertain = { q = 1 }
[[agent]]
ids = [1]"""
OWN = """[[agent]]
ids = [2]
order = 1
f = "c*x1"
b = 1
cost = "s^2"
constants = { c = 1 }
"""
WRONG = [
    # what people mistype
    Wrong("a key misspelt", "zero_dynamics =", "zero_dynamic =", "did you mean 'zero_dynamics'?"),
    Wrong("a table misspelt", "[exosystem]", "[exosytem]", "did you mean 'exosystem'?"),
    Wrong("a name misspelt", F, "-k*x1 + p*x2 + z1 + V1", "did you mean 'v1'?"),
    Wrong("one bracket", "[[agent]]", "[agent]", "two brackets"),
    Wrong("ids misspelt", "ids = [1, 2]", "id = [1, 2]", "did you mean 'ids'?"),
    Wrong("no ids", "ids = [1, 2]\n", "", "for example ids = [1, 2]"),
    Wrong("no order", "order = 2\n", "", "for example order = 2"),
    Wrong("no cost", 'cost = "(s - id)^2"\n', "", 'for example cost = "'),
    Wrong("no schema", 'schema = "consensus-plant/1"\n', "", 'for example schema = "consensus-plant/1"'),
    Wrong("schema of another version", "consensus-plant/1", "consensus-plant/2", "reads 'consensus-plant/1' only"),
    Wrong("no name", 'name = "two carts"\n', "", 'for example name = "'),
    Wrong("a name of two lines", '"two carts"', '"two\\ncarts"', "a line of 1 to 200 printable characters"),
    Wrong("no quotes around an expression", f'"{F}"', F, "stand in quotes"),
    Wrong("no quotes around a name", '["v1", "v2"]', "[v1, v2]", "stand in quotes"),
    Wrong("a quote is missing", 'name = "two carts"', 'name = "two carts', "closed on its line"),
    Wrong("a decimal without digits", "box = [-1, 1]", "box = [-1., 1]", "digits on both sides of a decimal point"),
    Wrong(
        "a bracket is missing",
        '["1 -> 2", "2 -> 1"]\n\n[constants]',
        '["1 -> 2", "2 -> 1"\n\n[constants]',
        "close it with ]",
    ),
    Wrong("a key twice", "eta = 0", "eta = 0\neta = 1", "a key is given once"),
    Wrong("a table twice", "[initial]", "[initial]\n[initial]", "a table is opened once"),
    # the network
    Wrong("an arrow to the left", '"2 -> 1"', '"1 <- 2"', 'an edge is written "j -> i"'),
    Wrong("edges as pairs", '["1 -> 2", "2 -> 1"]', "[[1, 2], [2, 1]]", 'an edge is "j -> i" or ["j -> i", weight]'),
    Wrong("an agent from 0", '"1 -> 2"', '"0 -> 2"', "agents are 1 to 2"),
    Wrong("an edge to itself", '"1 -> 2"', '"1 -> 1"', "leave this edge out"),
    Wrong("an edge twice", '"2 -> 1"', '"2 -> 1", "1 -> 2"', "leave one out, or add the weights"),
    Wrong("a weight of 0", '"2 -> 1"', '["2 -> 1", 0]', "leave the edge out where nothing is heard"),
    Wrong("edges as one text", '["1 -> 2", "2 -> 1"]', '"1 -> 2"', "write the entries in brackets"),
    Wrong("the number of agents as a text", "agents = 2", 'agents = "2"', "write digits only"),
    Wrong("no agents", "agents = 2", "agents = 0", "an integer from 1 to 1000"),
    # the agents
    Wrong("an agent in two tables", "ids = [1, 2]", "ids = [1, 2, 1]", "more than 2"),
    Wrong("an agent twice", "ids = [1, 2]", "ids = [1, 1]", "take it out of the ids of one table"),
    Wrong("an agent without a table", "ids = [1, 2]", "ids = [1]", "add one, or the number to the ids of another"),
    Wrong("an empty list of ids", "ids = [1, 2]", "ids = []", "for example ids = [1, 2]"),
    Wrong("a range of ids as in Python", "ids = [1, 2]", 'ids = "1:2"', 'a range is written "3-5"'),
    Wrong("a range of ids beyond the last", "ids = [1, 2]", 'ids = "1-5"', "a range of agents from 1 to 2"),
    Wrong("order 0", "order = 2", "order = 0", "an integer from 1 to 16"),
    Wrong("the input in f", F, f"{F} + u", "give its factor as b"),
    Wrong("the output in f", F, f"{F} + y", "write x1"),
    Wrong("time in f", F, f"{F} + sin(t)", "[exosystem]"),
    Wrong("x2 at order 1", "order = 2", "order = 1", "raise order if x1' is x2"),
    Wrong(
        "a state of the neighbour",
        "ids = [1, 2]",
        "ids = [2]\n" + NEIGHBOUR,
        "agents meet through the coordinator only",
    ),
    Wrong("an undeclared parameter", F, f"{F} + d", "declare others first"),
    Wrong("states in b", '"1/m"', '"1/m + x1^2"', "b depends on the parameters only"),
    Wrong("a parameter in the cost", COST, "p*(s - id)^2", "a cost depends on s and constants only"),
    Wrong("the cost in y", COST, "(y - id)^2", "may not appear here"),
    Wrong("x2 in the zero dynamics", '"-z1 + x1"', '"-z1 + x2"', "depend on z, x1, v and the parameters only"),
    Wrong("a zero state called like a state", "{ z1 =", "{ x3 =", "choose another one"),
    Wrong("a zero state with a prime", "{ z1 =", '{ "z1\'" =', "an ASCII letter, then"),
    Wrong("a parameter called s", "{ p = [-1, 1] }", "{ p = [-1, 1], s = 1 }", "choose another one"),
    Wrong("an interval the wrong way round", "{ p = [-1, 1] }", "{ p = [1, -1] }", "the smaller end comes first"),
    Wrong("an interval of three numbers", "{ p = [-1, 1] }", "{ p = [-1, 0, 1] }", "a pair [lo, hi]"),
    Wrong("an unbounded parameter", "{ p = [-1, 1] }", "{ p = [-1, inf] }", "a value that is never exceeded"),
    Wrong("an irrational end", "{ p = [-1, 1] }", '{ p = [-1, "sqrt(2)"] }', "write a fraction or a decimal near it"),
    Wrong("a constant in the wrong order", 'm = "3/2"\nk = "2*m"', 'k = "2*m"\nm = "3/2"', "before it is used"),
    Wrong("a polynomial that is too short", LAST, _end("gamma = []"), "1 number is needed"),
    Wrong("an observer that is too long", LAST, _end("observer = [1, 2, 1]"), "2 numbers are needed"),
    Wrong("M without N", LAST, _end("internal_model = { M = [[-1]] }"), "for example N ="),
    Wrong("an empty M", LAST, _end("internal_model = { M = [], N = [] }"), "leave internal_model out"),
    Wrong("an interval in quotes", "{ p = [-1, 1] }", '{ p = "[-1, 1]" }', "without quotes around it"),
    Wrong("gains in an agent's table", LAST, _end("gains = { K = 5 }"), "a table of its own, [gains]"),
    Wrong("parameters as a list", "{ p = [-1, 1] }", '["p"]', "a table is needed"),
    Wrong("zero dynamics as a text", '{ z1 = "-z1 + x1" }', '"-z1 + x1"', "a table is needed"),
    Wrong("a state without brackets", 'states = ["v1", "v2"]', 'states = "v1"', "write the entries in brackets"),
    Wrong("a unit", LAST, _end('[gains]\nK = "10 Nm"'), "units are left out"),
    Wrong("a state as a function of time", F, "-k*x1 + v1(t)", "a product is written with *"),
    # expressions
    Wrong("a product without a sign", F, "-k x1 + p*x2", "a product is written with *"),
    Wrong("a product with a dot", F, "-k·x1 + p*x2", "a product is written with *"),
    Wrong("a minus sign from a document", F, "\u2212k*x1", "the minus sign of the keyboard"),
    Wrong("the Greek letter", F, "-π*x1", "write pi"),
    Wrong("a square from a document", COST, "(s - id)²", "write ^2"),
    Wrong("an equation", F, "x2 = -k*x1", "not an equation"),
    Wrong("a comma in a decimal", F, "-0,5*x1", "decimals have a point"),
    Wrong("an open parenthesis", COST, "((s - id)^2", "expected ')'"),
    Wrong("an operator at the end", F, "-k*x1 +", "expected a number, a name or '('"),
    Wrong("ln for log", F, "ln(2 + x1)", "write log"),
    Wrong("an absolute value", F, "-k*abs(x1)", "which is smooth"),
    Wrong("a function of two numbers", F, "atan(x1, x2)", "functions one argument"),
    Wrong("a function without parentheses", F, "sin x1", "an argument in parentheses"),
    Wrong("a state in an exponent", F, "2^x1", "exp(p*log(a))"),
    Wrong("a root of a square", F, "sqrt(x1^2)", "sqrt(1/100 + x^2)"),
    Wrong("brackets for parentheses", F, "-k*[x1 + x2]", "use parentheses"),
    Wrong("a prime for a derivative", F, "-k*x1'", "derivatives are not written"),
    Wrong("a division by zero", F, "x1/(x2 - x2)", "vanishes identically"),
    Wrong("a number beyond floats", COST, "1e400*(s - id)^2", "choose another unit"),
    # exosystem and initial set
    Wrong("S is not square", "S = [[0, 1], [-1, 0]]", "S = [[0, 1]]", "one row and column per state"),
    Wrong("no S", "S = [[0, 1], [-1, 0]]\n", "", "for example S ="),
    Wrong("a start is missing", "{ v1 = 0, v2 = [-1, 1] }", "{ v1 = 0 }", "for example v2 = 0"),
    Wrong("no box", "box = [-1, 1]\n", "", "for example box = [-1, 1]"),
    Wrong("a component nobody has", "box = [-1, 1]", "box = [-1, 1]\nx = { x3 = 1 }", "no agent has a state"),
    Wrong(
        "three pairs for two states",
        "box = [-1, 1]",
        "box = [-1, 1]\nx = [[0, 1], [0, 1], [0, 1]]",
        "one interval for each",
    ),
    Wrong("numbers for pairs", "box = [-1, 1]", "box = [-1, 1]\nx = [[0, 1], 2]", "write [1, 1] for a point"),
    Wrong("measured misspelt", "observer = 0", 'observer = "messured"', 'did you mean "measured"?'),
    Wrong("an agent's constant in initial", "eta = 0\n", "eta = 'c'\n" + OWN, "declare it in [constants]"),
    # what is asked
    Wrong("a gain of 0", LAST, _end("[gains]\nK = 0"), "a positive number is needed"),
    Wrong("a gain in lower case", LAST, _end("[gains]\nk = 5"), "did you mean"),
    Wrong("gains of an agent that is not there", LAST, _end("[gains.3]\nK = 5"), "agents are 1 to 2"),
    Wrong("gains of agent 01", LAST, _end("[gains.01]\nK = 5"), "write 1 without leading zeros"),
    Wrong("settling as a number", LAST, _end("[requirements]\nsettling = 10"), "a table is needed"),
    Wrong("settling without a band", LAST, _end("[requirements]\nsettling = { time = 10 }"), "for example settling ="),
    Wrong("the largest region misspelt", LAST, _end('[requirements]\nregion = "biggest"'), '"largest" is needed'),
    Wrong("no period", LAST, _end('[implementation]\narithmetic = "double"'), "for example period ="),
    Wrong(
        "an unknown arithmetic",
        LAST,
        _end('[implementation]\nperiod = 1\narithmetic = "float32"'),
        '"double" or "single"',
    ),
    Wrong("a negative delay", LAST, _end("[implementation]\nperiod = 1\ndelay = -1"), "not negative is needed"),
    Wrong("a coordinator that is sampled alone", LAST, _end("[coordinator]\nperiod = 1"), "add [implementation]"),
    # the file as such
    Wrong("an empty file", "", "", "begin with schema", b"\n"),
    Wrong("a byte-order mark", "", "", "save it as UTF-8 without one", b"\xef\xbb\xbf" + PLANT.encode()),
    Wrong("UTF-16", "", "", "save it as UTF-8", PLANT.encode("utf-16")),
    Wrong("Latin-1", "", "", "save it as UTF-8", PLANT.replace("carts", "Wägen").encode("latin-1")),
    Wrong("JSON", "", "", "a line is key = value", b'{"schema": "consensus-plant/1"}'),
]
# at the limits of the readers
_HUGE = f"0x{'f' * 2000}"
_ROOTS = "[constants]\n" + "\n".join(f'r{k} = "sqrt({k}^2 + 1)"' for k in range(1, 50))
_FEW = PLANT.replace("agents = 2", "agents = 1000").replace("ids = [1, 2]", 'ids = "1-1000"')
_NESTED = "exp(exp(" * 7 + "sqrt(2)/9" + "/9)/9)" * 7
LIMITS = [
    Wrong("a text that is none", 'name = "two carts"', "name = 2", "write it in quotes"),
    Wrong("a truth value for an expression", f'"{F}"', "true", 'write 1.5 or "3/2"'),
    Wrong("an integer of 8000 bits", LAST, _end(f"[gains]\nK = {_HUGE}"), "another unit makes it shorter"),
    Wrong(
        "a number as SymPy knows it", "box = [-1, 1]", 'box = [-1, "sqrt(2)^2"]', "is the number 2; write it like that"
    ),
    Wrong("names that are numbers", '["v1", "v2"]', "[1, 2]", "write it in quotes"),
    Wrong("49 roots", "[constants]", _ROOTS, "write some as fractions"),
    Wrong(
        "17 zero states",
        "{ z1 =",
        "{ " + "".join(f"q{k} = 0, " for k in range(16)) + "z1 =",
        "17 zero states, more than 16",
    ),
    Wrong(
        "Lyapunov function of nothing",
        'zero_dynamics = { z1 = "-z1 + x1" }',
        "zero_dynamics_lyapunov = 1",
        "leave this out",
    ),
    Wrong("an expression of 10 001 characters", COST, f"{COST}{' ' * 9995}", "name its parts in [constants]"),
    Wrong("2001 operands", COST, "+".join(["s"] * 1001), "more than 2000 operands and operators"),
    Wrong("25 parentheses", COST, "(" * 25 + "s" + ")" * 25, "name an inner part in [constants]"),
    Wrong("1001 digits", COST, "9" * 1001 + "*s^2", "round it outwards"),
    Wrong("an exponent of 65", COST, "s^65", "must lie between -64 and 64"),
    Wrong("an exponent of 1/65", F, "(2 + p)^(1/65)", "a fraction near it may do"),
    Wrong("0 to the power 0", F, "(x1 - x1)^0", "write 1 or 0"),
    Wrong("a denominator of 0 in disguise", F, "x1/(sin(1)^2 + cos(1)^2 - 1)", "write its value"),
    Wrong("a constant beyond everything", 'm = "3/2"', 'm = "exp(exp(exp(9)))"', "of reasonable size"),
    Wrong("a constant in 14 functions", 'm = "3/2"', f'm = "{_NESTED}"', "as a fraction or a decimal"),
    Wrong("the root of a long number", 'm = "3/2"', f'm = "sqrt({"7" * 400})"', "as a fraction or a decimal"),
    Wrong("a power as exp of log", F, "exp(p*log(2 + x1))", "write the power instead"),
    Wrong("the root of a negative number", 'm = "3/2"', 'm = "sqrt(-1)"', "check its sign and its poles"),
    Wrong("a power that nobody expands", F, "(x1 + x2 + p + z1 + v1)^64", "expand or simplify it by hand"),
    Wrong(
        "five million characters", "", "", "name what is repeated", _FEW.replace(F, "+".join(["x1"] * 1700)).encode()
    ),
    Wrong("a long file", "", "", "one [[agent]] table may serve many agents", b"#" * 1_000_001),
    Wrong("a key of 33 parts", "", "", "has more than four", b".".join([b"a"] * 33) + b" = 1"),
    Wrong("thousands of brackets", "", "", "more than three brackets", b"x = " + b"[" * 100_000),
]
