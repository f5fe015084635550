#!/usr/bin/env python3
"""A car-following model of SUMO as an ego: pip install libsumo

    brakecheck eval runs/acc -- python3 examples/egos/sumo.py IDM
    brakecheck eval runs/acc -- python3 examples/egos/sumo.py ACC tau=0.6 emergencyDecel=6

The first word is a carFollowModel (IDM, EIDM, ACC, CACC, Krauss, …), the others are
attributes of its vType. SUMO itself moves the ego by one step behind the car that
brakecheck says is ahead. SUMO is EPL-2.0 or GPL-2.0-or-later; nothing of it is here.
"""
import pathlib
import sys
import tempfile

import libsumo
from protocol import lead_of, serve

ROAD_M, FROM_M, MOST_MPS = 100_000, 1_000, 33
NET = f"""<net version="1.16"><location netOffset="0,0" convBoundary="0,0,{ROAD_M},0" origBoundary="0,0,0,0" projParameter="!"/>
<edge id="e" from="a" to="b"><lane id="e_0" index="0" speed="70" length="{ROAD_M}" shape="0,0 {ROAD_M},0"/></edge>
<junction id="a" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,0"/>
<junction id="b" type="dead_end" x="{ROAD_M}" y="0" incLanes="e_0" intLanes="" shape="0,0"/></net>"""
model, attributes = sys.argv[1], dict(word.split("=") for word in sys.argv[2:])
words = {"maxSpeed": MOST_MPS, "speedFactor": 1, "speedDev": 0, **attributes}
TYPES = '<routes><vType id="ego" carFollowModel="%s" %s/><vType id="lead" maxSpeed="70"/><route id="r" edges="e"/></routes>' % (
    model, " ".join(f'{key}="{value}"' for key, value in words.items()))
folder = tempfile.TemporaryDirectory()
net, types = pathlib.Path(folder.name, "net.xml"), pathlib.Path(folder.name, "types.xml")
net.write_text(NET)
types.write_text(TYPES)


def reset(message):
    """A new SUMO; both cars enter far from each other, so that neither waits."""
    libsumo.close()
    libsumo.start(["sumo", "-n", str(net), "-r", str(types), "--step-length", str(message["sample_s"]), "--seed",
                   str(message["seed"] % 2**31), "--collision.action", "none", "--no-step-log", "--no-warnings"])
    for name, at_m in (("ego", FROM_M), ("lead", 0.9 * ROAD_M)):
        libsumo.vehicle.add(name, "r", typeID=name, departPos=str(at_m))
        libsumo.vehicle.setLaneChangeMode(name, 0)
    libsumo.simulationStep()


def control(step):
    own, lead, vehicle = step["own"], lead_of(step), libsumo.vehicle
    here_m = FROM_M + own["s_m"]
    there_m, there_mps = 0.9 * ROAD_M, MOST_MPS
    if lead:
        there_m, there_mps = here_m + lead["headway_m"], lead["speed_mps"]
        vehicle.setLength("lead", lead["length_m"])
    for name, at_m, speed_mps in (("ego", here_m, own["speed_mps"]), ("lead", there_m, there_mps)):
        vehicle.moveTo(name, "e_0", at_m)
        vehicle.setPreviousSpeed(name, speed_mps)
    vehicle.setSpeed("lead", there_mps)
    libsumo.simulationStep()
    return (vehicle.getSpeed("ego") - own["speed_mps"]) / step["sample_s"]


serve(f"SUMO {model}", reset, control)
