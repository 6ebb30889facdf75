"""Every message about a plant file, in one place: what is wrong, and what to change.

``docs/messages.md`` is made from this module and from ``tests/wrong/plants.py``, which holds a file for each of them.
"""

from __future__ import annotations

from dataclasses import dataclass


class Reason(str):
    """The text of a message, which remembers what it was made from."""

    message: Message


@dataclass(frozen=True)
class Message:
    """``text`` is a template in the notation of ``str.format``."""

    text: str

    def __call__(self, **parts: object) -> Reason:
        reason = Reason(self.text.format(**parts))
        reason.message = self
        return reason


# the file as such
UNREADABLE = Message("cannot be read: {why}")
EMPTY = Message('missing, the file is empty; begin with schema = "consensus-plant/1"')
TOO_LARGE = Message("the file is larger than {most} bytes; one [[agent]] table may serve many agents (ids)")
BYTE_ORDER_MARK = Message(
    "the file begins with a byte-order mark; save it as UTF-8 without one ('UTF-8', not 'with BOM')"
)
UTF_16 = Message("the file is UTF-16; save it as UTF-8")
NOT_UTF8 = Message("the file is not UTF-8; save it as UTF-8")
DEEP_KEY = Message("a dotted key has more than 32 parts; no key of a plant file has more than four")
TOO_DEEP = Message("the file is nested too deeply; no value of a plant file has more than three brackets")
NOT_TOML = Message("not valid TOML: {why}{hint}")

# tables and keys
MISSING = Message("missing; for example {example}")
UNKNOWN_KEY = Message("unknown key {key}; {hint}")
TABLE_OF_ITS_OWN = Message(
    "'{key}' is no part of an agent: it is a table of its own, [{key}]; [gains.3] is that of agent 3"
)
SCHEMA = Message("this version reads {schema} only; write that")
TABLE = Message("a table is needed, found {found}; write {{ key = value }}, or the keys below [{key}]")
ARRAY = Message("an array is needed, found {found}; write the entries in brackets: [ ... ]")
TOO_MANY = Message("{count} {what}, more than {most}")
STRING = Message("a string is needed, found {found}; write it in quotes")
LINE = Message("a line of 1 to {most} printable characters is needed")
INTEGER = Message("an integer is needed, found {found}; write digits only")
INTEGER_RANGE = Message("an integer from {least} to {most} is needed")
WORD = Message("{words} is needed{hint}")

# numbers and intervals
NUMBER = Message('a number or a string with an expression is needed, found {found}; write 1.5 or "3/2"')
INTEGER_BITS = Message("the integer has more than {most} bits; another unit makes it shorter")
FINITE = Message("a finite number is needed, found {found}; write a value that is never exceeded")
RATIONAL = Message("a rational number is needed, {text} is not shown to be one; write a fraction or a decimal near it")
PLAIN_NUMBER = Message("{text} is the number {value}; write it like that")
POSITIVE = Message("a positive number is needed, found {found}")
NOT_NEGATIVE = Message("a number that is not negative is needed, found {found}")
INTERVAL = Message("an interval is a pair [lo, hi] of numbers, or one number for a point")
INTERVAL_TEXT = Message("an interval is a pair [lo, hi] without quotes around it; its ends may have some")
EMPTY_INTERVAL = Message("the interval [{lo}, {hi}] is empty; the smaller end comes first")
LENGTH = Message("{needed} needed, found {found}")

# names
NAME = Message("a name is needed, found {found}; write it in quotes")
NOT_A_NAME = Message("{name} is not a name: an ASCII letter, then at most {most} letters, digits or underscores")
NAME_TAKEN = Message("the name {name} is taken: {role}; choose another one")
IRRATIONAL = Message("more than {most} constants that are not rational; write some as fractions or where they are used")

# the network
EDGE = Message('an edge is "j -> i" or ["j -> i", weight]')
ARROW = Message('an edge is written "j -> i", found {found}')
NO_AGENT = Message("there is no agent {number}; agents are 1 to {most}")
HEARS_ITSELF = Message("agent {number} cannot hear itself; leave this edge out")
EDGE_TWICE = Message("the edge {source} -> {target} is given twice; leave one out, or add the weights")
WEIGHT = Message("a weight is positive, found {found}; leave the edge out where nothing is heard")

# the exosystem
SQUARE = Message("a {size} by {size} matrix is needed, one row and column per state")

# the agents
TWO_BRACKETS = Message("agents are given as [[agent]] tables, with two brackets")
NO_TABLE = Message("{agents} no [[agent]] table; add one, or the number to the ids of another")
DESCRIBED_TWICE = Message("agent {number} is described twice; take it out of the ids of one table")
NO_IDS = Message("at least one agent is needed; for example ids = [1, 2]")
RANGE = Message('a range is written "3-5", found {found}')
RANGE_ENDS = Message("a range of agents from 1 to {most} is needed, found {found}")
TOO_MUCH_TEXT = Message(
    "the expressions of all agents together have more than {most} characters; name what is repeated"
)
NO_ZERO_DYNAMICS = Message("there are no zero dynamics; leave this out")
NO_ROWS = Message("at least one row is needed; leave internal_model out to have one chosen")

# the initial box
NO_BOX = Message("missing, and there is no initial.box to stand for it; for example box = [-1, 1]")
MEASURED = Message('unknown word {word}; did you mean "measured"?')
COMPONENTS = Message("one interval for each of {names} is needed, found {found}")
PAIR = Message("an interval is a pair [lo, hi]; write [1, 1] for a point")
NO_STATE = Message("no agent has a state {name}; {hint}")

# what is asked of the controller
PERIOD_ALONE = Message("only a sampled controller has one; add [implementation] with its period, or leave this out")
LEADING_ZEROS = Message("write {number} without leading zeros")

# names in expressions
UNKNOWN_NAME = Message("unknown name {name}; {hint}")
NOT_HERE = Message("{name} may not appear here: {because}")
INPUT_IN_F = Message("'u' may not appear here: the input enters as b*u; leave it out and give its factor as b")
OUTPUT = Message("'y' may not appear here: the output is x1; write x1")
TIME = Message("'t' may not appear here: nothing depends on time but through the states of the [exosystem]")
HIGHER_STATE = Message(
    "'{name}' may not appear here: order = {order}, so the states are {chain}; raise order if x{order}' is x{next}"
)
COMES_LATER = Message("'{name}' is declared further down; declare a constant before it is used")
OWN_CONSTANT = Message(
    "'{name}' is a constant of one [[agent]] table, and [initial] is shared; declare it in [constants]"
)
OTHER_AGENTS = Message("'{name}' belongs to another [[agent]] table; agents meet through the coordinator only")

# expressions
TOO_LONG = Message("the expression has {found} characters, more than {most}; name its parts in [constants]")
CHARACTER = Message("unexpected character {found}{hint}")
OPERATOR = Message("expected an operator, found {found}{hint}")
OPERAND = Message("expected a number, a name or '(', found {found}")
PARENTHESIS = Message("expected ')', found {found}")
FUNCTION = Message("unknown function {name}; known: {known}")
ARGUMENT = Message("the function {name} needs an argument in parentheses")
TOO_MANY_PARTS = Message("the expression has more than {most} operands and operators")
NESTED = Message("the expression is nested deeper than {most}; name an inner part in [constants], or simplify")
DIGITS = Message("the number has {found} digits, more than {most}; round it outwards")
EXPONENT_OF_TEN = Message("the number's exponent is beyond {most}, which no float holds; choose another unit")
EXPONENT = Message("an exponent must be a rational constant such as 2 or 1/3 (a^p with another p is exp(p*log(a)))")
EXPONENT_SIZE = Message("an exponent must lie between -{most} and {most}")
EXPONENT_ROOT = Message("the denominator of an exponent must be at most {most}; a fraction near it may do")
DIVISION = Message("division by zero; the denominator vanishes identically")
ZERO_POWER = Message("0 to the power 0; write 1 or 0, whatever is meant")
DIVISION_UNSHOWN = Message("division by a constant that is not shown to be nonzero; write its value")
CONSTANT_SIZE = Message("the constant is not a finite real number of reasonable size (at most 1e{most} in magnitude)")
CONSTANT_NESTED = Message("the constant is nested too deeply; write its value as a fraction or a decimal")
ROOT_BITS = Message("sqrt of a number with more than {most} bits; write its value as a fraction or a decimal")
LOG_IN_EXP = Message("log inside exp; write the power instead")
NOT_REAL = Message("{what} is not a finite real number; check its sign and its poles")
NOT_SMOOTH = Message("{what} becomes {found}, not a smooth function of the language; sqrt(1/100 + x^2) is a smooth one")
EXPANSION = Message("the expression is too large: its {what} may pass {most}; expand or simplify it by hand")

ALL = {name: value for name, value in list(globals().items()) if isinstance(value, Message)}
