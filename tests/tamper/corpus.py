"""Which mutants are tried, in an order that is the same for every number of workers."""

from __future__ import annotations

import hashlib
import random
from collections.abc import Iterator, Sequence
from itertools import islice

from .bases import Base, encode
from .mutations import Mutant, plant_edits, random_mutant, replaced, systematic

LARGE_SHARE = 25  # of 1000 mutants, this many change a large certificate: one such check takes up to some seconds
PLANT_SHARE = 20  # and this many change the plant file and bind the certificate to the new one


def corpus(bases: Sequence[Base], count: int, seed: int) -> Iterator[Mutant]:
    """``count`` different mutants: all systematic ones of the small plants that fit, a sample for the large ones,
    then random ones."""
    small = [k for k, base in enumerate(bases) if not base.large]
    large = [k for k, base in enumerate(bases) if base.large]
    seen = {hashlib.sha256(encode(base.certificate) + base.plant).digest() for base in bases}
    for_large = count * LARGE_SHARE // 1000 if large else 0
    yield from _new(_sample(bases, large, for_large, seed), seen, bases)
    for_plants = count * PLANT_SHARE // 1000
    yield from _new(_plants(bases, small, for_plants, seed), seen, bases)
    rest = count - for_large - for_plants
    listed = [mutant for k in small for mutant in systematic(bases, k)]
    if rest < len(listed):
        listed = random.Random(seed).sample(listed, rest)
    for mutant in _new(iter(listed), seen, bases):
        rest -= 1
        yield mutant
    rng = random.Random(seed + 1)
    weights = [1 if len(bases[k].certificate["claim"]["agents"]) > 1 else 4 for k in small]
    endless = (random_mutant(bases, rng.choices(small, weights)[0], rng) for _ in iter(int, 1))
    yield from islice(_new(endless, seen, bases), rest)


def _new(mutants: Iterator[Mutant], seen: set[bytes], bases: Sequence[Base]) -> Iterator[Mutant]:
    """Those with bytes not seen before."""
    for mutant in mutants:
        digest = hashlib.sha256(mutant.certificate + (mutant.plant or bases[mutant.base].plant)).digest()
        if digest not in seen:
            seen.add(digest)
            yield mutant


def _sample(bases: Sequence[Base], indices: Sequence[int], count: int, seed: int) -> Iterator[Mutant]:
    """Of every path at least one mutant, as far as the count goes: each path's mutants in a random order, taken in
    turns."""
    rng = random.Random(seed)
    for k in indices:
        by_path: dict[str, list[Mutant]] = {}
        for mutant in systematic(bases, k):
            by_path.setdefault(mutant.path, []).append(mutant)
        for group in by_path.values():
            rng.shuffle(group)
        depth = max(map(len, by_path.values()))
        turns = [group[turn] for turn in range(depth) for group in by_path.values() if turn < len(group)]
        yield from turns[: count // len(indices)]


def _plants(bases: Sequence[Base], indices: Sequence[int], count: int, seed: int) -> Iterator[Mutant]:
    """Edited plant files, with the certificate as it is and with the certificate bound to the edited file."""
    mutants = []
    for k in indices:
        base = bases[k]
        for operator, plant in plant_edits(base.plant):
            digest = hashlib.sha256(plant).hexdigest()
            bound = replaced(base.certificate, ("claim", "plant_sha256"), digest)
            mutants.append(Mutant(k, operator, "plant, bound again", bound, plant))
            mutants.append(Mutant(k, operator, "plant", base.certificate, plant))
    rng = random.Random(seed)
    rng.shuffle(mutants)
    yield from mutants[:count]
