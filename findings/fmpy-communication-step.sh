#!/usr/bin/env bash
# FMPy 0.3.32: a co-simulation unit that declares fixedInternalStepSize 0.01 and that it cannot vary its communication
# step is stepped by 0.01 up to stop_time = 10, by 0.02 at 11 and by 0.04 at 21: the length of a run changes the
# sampling rate, without a word. step_size = 0.01 does not help; output_interval, "interval for sampling the output" by
# its docstring, is the communication step. A sampled controller has to check the step it is given.
# Output seen: stop_time 10: [0.01]; 11: [0.02]; 21: [0.04]; 21 with step_size 0.01: [0.04]; with output_interval 0.01: [0.01]
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet fmpy==0.3.32
mkdir "$place/unit"
cat > "$place/unit/modelDescription.xml" <<'XML'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="sampled" instantiationToken="{1}">
  <CoSimulation modelIdentifier="sampled" canHandleVariableCommunicationStepSize="false" fixedInternalStepSize="0.01"/>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.01"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <Float64 name="u" valueReference="1" causality="output" variability="discrete" initial="calculated"/>
  </ModelVariables>
  <ModelStructure><Output valueReference="1"/><InitialUnknown valueReference="1"/></ModelStructure>
</fmiModelDescription>
XML
"$place/venv/bin/python" - "$place/unit" <<'PYTHON'
import sys

import fmpy


class Unit:
    """Stands for the shared library and keeps the steps that it is asked for."""

    def __init__(self):
        self.steps = set()

    def doStep(self, currentCommunicationPoint, communicationStepSize):
        self.steps.add(round(communicationStepSize, 9))
        return False, False, False, currentCommunicationPoint + communicationStepSize

    def getFloat64(self, vr, nValues):
        return [0.0] * nValues

    def __getattr__(self, name):
        return lambda *arguments, **named: None


def steps(**options):
    unit = Unit()
    fmpy.simulate_fmu(sys.argv[1], fmi_type="CoSimulation", fmu_instance=unit, output=["u"], **options)
    return sorted(unit.steps)


runs = [dict(stop_time=10), dict(stop_time=11), dict(stop_time=21), dict(stop_time=21, step_size=0.01),
        dict(stop_time=21, output_interval=0.01)]
found = [steps(**options) for options in runs]
print(f"FMPy {fmpy.__version__}:", *(f"{options}: {seen}" for options, seen in zip(runs, found)), sep="\n  ")
assert found == [[0.01], [0.02], [0.04], [0.04], [0.01]], "the behaviour has changed"
PYTHON
