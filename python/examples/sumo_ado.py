#!/usr/bin/env python3
"""A trained ado in SUMO, ahead of a driver of SUMO. Run pip install libsumo first.

    python3 sumo_ado.py runs/acc Krauss tau=0.5 decel=3 emergencyDecel=3
"""
import pathlib
import sys
import tempfile

import libsumo
from brakecheck import Ado
from drive import play, report

NET = """<net version="1.16"><location netOffset="0,0" convBoundary="0,0,9000,0" origBoundary="0,0,0,0" projParameter="!"/>
<edge id="e" from="a" to="b"><lane id="e_0" index="0" speed="33" length="9000" shape="0,0 9000,0"/></edge>
<junction id="a" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,0"/>
<junction id="b" type="dead_end" x="9000" y="0" incLanes="e_0" intLanes="" shape="0,0"/></net>"""
TYPES = """<routes><route id="r" edges="e"/><vType id="ado" maxSpeed="70" length="4.54"/>
<vType id="ego" carFollowModel="%s" length="4.54" speedFactor="1" speedDev="0" %s/></routes>"""
run, model, *attributes = sys.argv[1:]
folder = tempfile.TemporaryDirectory()
net, types = pathlib.Path(folder.name, "net.xml"), pathlib.Path(folder.name, "types.xml")
net.write_text(NET)
types.write_text(TYPES % (model, " ".join('%s="%s"' % tuple(word.split("=")) for word in attributes)))


def begin(start, step_s):
    """Begins in SUMO, and returns the function that moves both by a step."""
    libsumo.close()
    libsumo.start(["sumo", "-n", str(net), "-r", str(types), "--step-length", str(step_s),
                   "--collision.action", "none", "--no-warnings", "--no-step-log"])
    for name, at_m in (("ego", 100), ("ado", 4000)):  # far apart, so that neither waits
        libsumo.vehicle.add(name, "r", typeID=name, departPos=str(at_m))
    libsumo.simulationStep()
    for name, at_m in (("ego", 100), ("ado", 100 + start["headway"])):
        libsumo.vehicle.moveTo(name, "e_0", at_m)
        libsumo.vehicle.setPreviousSpeed(name, start[f"{name}.speed"])
    libsumo.vehicle.setSpeedMode("ado", 0)  # drives as it is told
    return move


def move(speed, step_s):
    libsumo.vehicle.setSpeed("ado", speed)
    libsumo.simulationStep()
    ego, ado = (libsumo.vehicle.getPosition(name)[0] for name in ("ego", "ado"))
    return ado - ego, libsumo.vehicle.getSpeed("ego"), libsumo.vehicle.getAcceleration("ego")


report(" ".join(["SUMO", model, *attributes]), play(Ado(run), begin))
