"""Which mutants are tried, in an order that is the same for every number of workers."""

from __future__ import annotations

import hashlib
import random
import re
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import chain, islice

from .bases import Base, Json, encode
from .mutations import (
    Mutant,
    Path,
    at,
    mutant,
    other_certificates,
    other_writings,
    paths,
    plant_edits,
    random_mutant,
    replaced,
    systematic,
)
from .values import changes, is_number, number_values

FLOOR = 0.25  # of all mutants at most this part is spread over the bases whatever they cost
PLANTS = 0.02  # and this part changes the plant file and binds the certificate to the new one
REQUIRED = 0.1  # and this part, where there are requirements, asks for others in the plant file and in the claim
CHEAP = 1_000_000  # steps of the checker


def corpus(bases: Sequence[Base], count: int, seed: int) -> Iterator[Mutant]:
    """``count`` different mutants of the bases, and of the plant files that they are about."""
    return islice(_endless(bases, count, seed), count)


def _endless(bases: Sequence[Base], count: int, seed: int) -> Iterator[Mutant]:
    """Shared out for ``count`` of them.

    Every base gets one for each of its fields, if the count allows; the rest is shared out by the inverse square of
    what a check costs, so that the cheap bases carry most mutants and the dear ones do not take all the time.
    """
    fields = [len(_fields(base.certificate)) for base in bases]
    scale = min(1.0, FLOOR * count / sum(fields))
    floors = [round(scale * number) for number in fields]
    of_plants = round(PLANTS * count)
    asking = [k for k, base in enumerate(bases) if asks(base)]
    of_requirements = round(REQUIRED * count) if asking else 0
    weights = [1 / base.cost**2 for base in bases]
    rest = count - of_plants - of_requirements - sum(floors)
    quotas = [floor + int(rest * weight / sum(weights)) for floor, weight in zip(floors, weights, strict=True)]
    seen = {_digest(base.plant, base) for base in bases}
    order = sorted(range(len(bases)), key=lambda k: bases[k].cost)
    rngs = {k: random.Random(f"{seed}/{bases[k].name}") for k in order}
    mutants = {k: _new(_of_base(bases, k, quotas[k], rngs[k]), seen, bases) for k in order}
    for k in order:  # first what every base gets, so that a run that is cut short has seen all of them
        yield from islice(mutants[k], floors[k])
    for k in order:
        yield from islice(mutants[k], quotas[k] - floors[k])
    cheap = [k for k in order if bases[k].cost < CHEAP] or order[:1]
    yield from islice(_new(_plants(bases, cheap, random.Random(seed)), seen, bases), of_plants)
    yield from islice(_new(_required(bases, asking, random.Random(seed)), seen, bases), of_requirements)
    rng = random.Random(seed)
    endless = (random_mutant(bases, order[0], rng) for _ in iter(int, 1))
    yield from _new(endless, seen, bases)


def every_number(bases: Sequence[Base], seed: int) -> Iterator[Mutant]:
    """Every number of every base once, each changed to another one."""
    for k in sorted(range(len(bases)), key=lambda k: bases[k].cost):
        base, rng = bases[k], random.Random(f"{seed}/{bases[k].name}")
        for path in paths(base.certificate):
            value = at(base.certificate, path)
            if is_number(value):
                yield mutant(k, *rng.choice(number_values(value)), path, base.certificate)


def _of_base(bases: Sequence[Base], k: int, quota: int, rng: random.Random) -> Iterator[Mutant]:
    """All systematic mutants and then random ones, if there is room for them; else a sample, field by field."""
    numbers = sum(1 for _ in paths(bases[k].certificate))
    if quota > 100 * numbers:
        yield from systematic(bases, k)
    else:
        few = [*other_writings(bases, k), *other_certificates(bases, k)]
        rng.shuffle(few)
        groups = list(_fields(bases[k].certificate).values())
        turns = (_changed(bases, k, rng.choice(group), rng) for _ in iter(int, 1) for group in groups)
        yield from islice(chain(islice(turns, len(groups)), few, turns), 3 * quota)
    while True:
        yield random_mutant(bases, k, rng)


def _changed(bases: Sequence[Base], k: int, path: Path, rng: random.Random) -> Mutant:
    certificate = bases[k].certificate
    return mutant(k, *rng.choice(changes(at(certificate, path))), path, certificate)


def _fields(certificate: Json) -> dict[tuple[object, ...], list[Path]]:
    """All paths by field: of a list the first, the last and those between; every agent has its own fields."""
    found: dict[tuple[object, ...], list[Path]] = {}
    for path in paths(certificate):
        here, shape = certificate, []
        for depth, key in enumerate(path):
            place = 0 if key == 0 else -1 if isinstance(here, list) and key == len(here) - 1 else "between"
            shape.append(place if isinstance(key, int) and depth != 2 else key)
            here = here[key]
        found.setdefault(tuple(shape), []).append(path)
    return found


def _digest(plant: bytes, base: Base, certificate: bytes | None = None) -> bytes:
    return hashlib.sha256((encode(base.certificate) if certificate is None else certificate) + plant).digest()


def _new(mutants: Iterator[Mutant], seen: set[bytes], bases: Sequence[Base]) -> Iterator[Mutant]:
    """Those with bytes not seen before."""
    for found in mutants:
        base = bases[found.base]
        digest = _digest(found.plant or base.plant, base, found.certificate)
        if digest not in seen:
            seen.add(digest)
            yield found


def _plants(bases: Sequence[Base], indices: Sequence[int], rng: random.Random) -> Iterator[Mutant]:
    """Edited plant files, with the certificate as it is and with the certificate bound to the edited file."""
    mutants = []
    for k in indices:
        base = bases[k]
        for operator, plant in plant_edits(base.plant):
            digest = hashlib.sha256(plant).hexdigest()
            bound = replaced(base.certificate, ("claim", "plant_sha256"), digest)
            mutants.append(Mutant(k, operator, "plant, bound again", bound, plant))
            mutants.append(Mutant(k, operator, "plant", base.certificate, plant))
    rng.shuffle(mutants)
    yield from mutants


def asks(base: Base) -> bool:
    """Whether the claim repeats requirements of its plant file."""
    return any(any(entry.get("requirements", {}).values()) for entry in base.certificate["claim"]["agents"])


def _required(bases: Sequence[Base], indices: Sequence[int], rng: random.Random) -> Iterator[Mutant]:
    """One number of ``[requirements]`` changed in the plant file and, alike for all agents, in the claim: closer and
    closer to what the witness proves, and beyond. The witness is kept."""
    while indices:
        k = rng.choice(indices)
        base, (table, key) = (
            bases[k],
            rng.choice((("settling", "time"), ("settling", "band"), ("", "input"), ("", "bandwidth"))),
        )
        source = base.plant.decode()
        found = re.search(rf'\b{key} = "?([\d./]+)"?', source)
        if found is None:
            continue
        value = Fraction(found[1]) * Fraction(round(2 ** rng.uniform(-7, 2), 3)).limit_denominator(1000)
        if value <= 0:
            continue
        plant = (source[: found.start()] + f'{key} = "{value}"' + source[found.end() :]).encode()
        certificate = replaced(base.certificate, ("claim", "plant_sha256"), hashlib.sha256(plant).hexdigest())
        for place in range(len(certificate["claim"]["agents"])):
            where = ("claim", "agents", place, "requirements", *((table,) if table else ()), key)
            certificate = replaced(certificate, where, str(value))
        yield Mutant(k, f"{key} of all is {value}", "requirements", certificate, plant)
