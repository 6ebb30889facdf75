"""The steps of a study, each from a study to a larger one; what cannot be done is said on stderr and adds nothing."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from certify.assumptions.check import check_assumptions
from certify.certificate import certificate_bytes
from certify.optimum import NoOptimumError, optimum
from certify.pipeline import design_gains, tool_versions
from certify.statement.controller import certified_controller
from reports.command_line.demonstration import demonstration_controller
from reports.command_line.derive import derived
from reports.command_line.inputs import Given
from reports.command_line.steps import Steps
from reports.command_line.verify import announced
from reports.designs import designed_plant
from reports.runs import obstacle, sentence
from reports.study import Study, conclusion, source_date
from sims.deadline import settled_run
from sims.signals import Array
from symbolic.controller import Controller
from symbolic.derivation import derive
from symbolic.plant import Plant


def started(plant: Plant, command: Sequence[str | Path]) -> Study:
    """A study of the plant in which nothing has been done."""
    line = shlex.join(["certify", *map(str, command)])
    return Study(plant, versions=tool_versions(), commands=(line,), date=source_date(os.environ))


def with_check(study: Study, steps: Steps) -> Study:
    """The assumptions."""
    with steps.step("check") as report:
        check = check_assumptions(study.plant)
        report(check.status)
    return replace(study, check=check)


def with_derivation(study: Study, source: str, steps: Steps) -> Study:
    """``s*`` and the error coordinates."""
    derivation = derived(study.plant, source, steps)
    try:
        found = optimum(study.plant)
    except NoOptimumError:
        return replace(study, derivation=derivation)
    study = replace(study, optimum=found.exact, optimum_enclosure=found.enclosure, derivation=derivation)
    return _with_designs(study)


def with_gains(study: Study, route: str, steps: Steps) -> Study:
    """A certificate, or the reason why there is none."""
    with steps.step("gains") as report:
        gains = design_gains(study.plant, route=route, progress=report.progress, check=study.check, share=report.share)
        report(gains.status if gains.certificate is not None else f"{gains.status}: {gains.reason}")
    return replace(study, gains=gains)


def with_certificate(study: Study, certificate: Given, steps: Steps) -> Study:
    """The certificate that was given, and the independent checker's answer on it."""
    return with_verification(replace(study, certificate=certificate.as_certificate()), steps, certificate)


def with_verification(study: Study, steps: Steps, certificate: Given | None = None) -> Study:
    """The independent checker's answer on the bytes that were given, else on those of the certificate found."""
    found = study.found_certificate
    if found is None:
        return study
    answer = announced(
        Given("the plant file", study.plant.source),
        certificate or Given("the certificate", certificate_bytes(dict(found))),
        steps,
    )
    return _with_designs(replace(study, verification=answer))


def _with_designs(study: Study) -> Study:
    """The derivation for the observers, ``γ`` and internal models that a verified certificate has chosen."""
    certificate = study.verified_certificate
    if study.derivation is None or certificate is None:
        return study
    plant = designed_plant(study.plant, certificate["claim"])
    return replace(study, derivation=derive(plant, study.derivation.s_star))


def with_simulation(study: Study, steps: Steps) -> Study:
    """A run from the centre of the boxes: with the gains of a verified certificate if floats can follow them, else with
    moderate gains."""
    with steps.step("simulate") as report:
        reason = "nothing was derived" if study.derivation is None else obstacle(study.plant, study.derivation)
        if study.derivation is None or reason:
            report(reason)
            return study
        controller = _simulable(study) or demonstration_controller(study.plant, study.derivation)
        trajectory = settled_run(study.plant, controller, lambda horizon: _samples(controller, horizon))
        report(sentence(trajectory))
    return replace(study, trajectory=trajectory, simulated=controller)


def _simulable(study: Study) -> Controller | None:
    certified = study.certified
    if certified is None or certified.too_large or not conclusion(study).verified:
        return None
    return certified_controller(study.found_certificate or {}, study.plant, "the certificate")


def _samples(controller: Controller, horizon: float) -> Array:
    """Equidistant instants, and more at the start, where the fastest observer peaks."""
    fastest = max((float(law.h) for law in controller.agents if law.h is not None), default=1.0)
    start = np.geomspace(min(horizon / 2000, 0.01 / fastest), horizon / 100, 300)
    samples: Array = np.union1d(np.linspace(0.0, horizon, 1001), start)
    return samples
