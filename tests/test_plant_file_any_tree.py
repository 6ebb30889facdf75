"""Whatever the tree or the bytes of a plant file: a plant, or one line; never a traceback."""

from __future__ import annotations

import copy
import tomllib

from fuzz.mutated_plants import document, places
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_texts import BASE, read, refusal

from symbolic.errors import InputError
from symbolic.plant_file import parse_plant

TREE = tomllib.loads(BASE)
KEYS = sorted({key for _, key in places(TREE) if isinstance(key, str)})
EXPRESSIONS = [
    "x1",
    "x2/0",
    "z1^2",
    "sqrt(2)",
    "id",
    "1/3",
    "s",
    "(((",
    "__import__('os')",
    "9**9**9",
    "log(p1)",
    "A*theta",
]
scalars = st.one_of(
    st.booleans(),
    st.integers(-3, 20),
    st.integers(-(2**70), 2**70),
    st.floats(),
    st.text(max_size=8),
    st.sampled_from(EXPRESSIONS),
    st.sampled_from(["measured", "1 -> 2", "1-2"]),
)
trees = st.recursive(
    scalars,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(st.one_of(st.sampled_from(KEYS), st.text(max_size=4)), inner, max_size=3),
    ),
    max_leaves=6,
)


def test_the_tree_is_written_back_as_it_was() -> None:
    assert tomllib.loads(document(TREE).decode()) == TREE
    plant = parse_plant(document(TREE), "p.toml")
    assert plant.agents == read(BASE).agents


@given(st.data())
@settings(max_examples=400)
def test_any_mutation_is_a_plant_or_one_line(data: st.DataObject) -> None:
    tree = copy.deepcopy(TREE)
    for _ in range(data.draw(st.integers(1, 3))):
        container, key = data.draw(st.sampled_from(places(tree)))
        match data.draw(st.sampled_from(["replace", "delete", "swap", "wrap", "add"])):
            case "delete":
                del container[key]
            case "swap":
                other, there = data.draw(st.sampled_from(places(tree)))
                container[key] = copy.deepcopy(other[there])
            case "wrap":
                container[key] = [container[key]]
            case "add" if isinstance(container[key], dict):
                container[key][data.draw(st.sampled_from(KEYS))] = data.draw(trees)
            case "add" if isinstance(container[key], list):
                container[key].append(data.draw(trees))
            case _:
                container[key] = data.draw(trees)
        if not tree:
            break
    try:
        plant = parse_plant(document(tree), "p.toml")
    except InputError as error:
        assert all(line.isprintable() and line.startswith("p.toml:") for line in error.lines)
        return
    assert hash(plant) == hash(parse_plant(document(tree), "p.toml"))
    assert [agent.id for agent in plant.agents] == list(range(1, plant.digraph.agents + 1))


@given(st.binary(max_size=200))
def test_any_bytes_are_one_line(data: bytes) -> None:
    assert refusal(data)


@given(st.integers(0, len(BASE) - 1), st.integers(0, 30), st.text(max_size=3))
def test_any_edit_of_the_text_is_a_plant_or_one_line(start: int, length: int, new: str) -> None:
    try:
        read((BASE[:start] + new + BASE[start + length :]).encode("utf-8", "replace").decode())
    except InputError as error:
        assert all(line.isprintable() for line in error.lines)
