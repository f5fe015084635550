#!/usr/bin/env python3
"""A co-simulation FMU of FMI 2 as an ego: pip install fmpy

    brakecheck eval runs/acc -- python3 examples/egos/fmu.py Mine.fmu
    brakecheck eval runs/acc -- python3 examples/egos/fmu.py Mine.fmu v_x=speed headway_s=1.2 a_wish=command

Words map its Real variables: `INPUT=QUANTITY` of those below, `OUTPUT=command` for the acceleration in
m/s², `INPUT=NUMBER` or `PARAMETER=NUMBER` for what stays. An input that is called as a quantity
needs no word, nor does an only output. Each episode has an instance of its own; a sample sets the
inputs, does one step, and reads the command. FMPy is BSD-2-Clause, an FMU is whose it is.
"""
import sys
import tempfile

import fmpy
from fmpy.fmi2 import FMU2Slave
from protocol import lead_of, serve

QUANTITIES = ("time", "speed", "accel", "gap", "lead_speed", "lead_accel")  # SI units; `gap` is clearance
path, words = sys.argv[1], dict(word.split("=") for word in sys.argv[2:])
model = fmpy.read_model_description(path)
if model.coSimulation is None or model.fmiVersion != "2.0":
    sys.exit(f"{path} is of FMI {model.fmiVersion}, or not for co-simulation: an FMU of FMI 2 that steps itself is needed")
real = {each.name: each for each in model.modelVariables if each.type == "Real"}
names = {kind: [name for name in real if real[name].causality == kind] for kind in ("input", "parameter", "output")}
if "command" not in words.values() and len(names["output"]) == 1:
    words[names["output"][0]] = "command"
words = {name: name if name in QUANTITIES else "nothing" for name in names["input"]} | words
fed = {name: word for name, word in words.items() if word in QUANTITIES and name in names["input"]}
fixed = {name: float(word) for name, word in words.items() if word[-1:].isdigit() and name in names["input"] + names["parameter"]}
command = [name for name, word in words.items() if word == "command" and name in names["output"]]
unclear = [f"{name}={word}" for name, word in words.items() if name not in {*fed, *fixed, *command}]
if unclear or len(command) != 1:
    has = "; ".join(f"as {kind}: {', '.join(of) or 'nothing'}" for kind, of in names.items())
    sys.exit(f"unclear: {', '.join(unclear) or 'OUTPUT=command'}. {path} has {has}; quantities are {', '.join(QUANTITIES)}")
folder, identifier = tempfile.TemporaryDirectory(), model.coSimulation.modelIdentifier
fmu = FMU2Slave(guid=model.guid, unzipDirectory=fmpy.extract(path, folder.name), modelIdentifier=identifier, instanceName="ego")
fed_as, fixed_as, read_as = ([real[name].valueReference for name in some] for some in (fed, fixed, command))


def reset(message):
    if getattr(fmu, "component", None):
        fmu.fmi2FreeInstance(fmu.component)
    fmu.instantiate()
    fmu.setupExperiment()
    fmu.setReal(fixed_as, fixed.values())
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()


def control(step):
    own, lead = step["own"], lead_of(step) or {"headway_m": 1e3, "length_m": 0.0, "ax_mps2": 0.0, **step["own"]}  # nobody: far away
    seen = (step["time_s"], own["speed_mps"], own["accel_mps2"], lead["headway_m"] - lead["length_m"], lead["speed_mps"], lead["ax_mps2"])
    fmu.setReal(fed_as, [seen[QUANTITIES.index(quantity)] for quantity in fed.values()])
    fmu.doStep(step["time_s"], step["sample_s"])
    return fmu.getReal(read_as)[0]


serve(f"FMU {model.modelName}", reset, control)
