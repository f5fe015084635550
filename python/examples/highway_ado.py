#!/usr/bin/env python3
"""A trained ado in highway-env, ahead of its IDM. Run pip install highway-env first.

    python3 highway_ado.py runs/acc
"""
import sys

from brakecheck import Ado
from drive import play, report
from highway_env.road.lane import StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

LONGER_M = Vehicle.LENGTH - 4.54


def begin(start, _step_s):
    """Begins in highway-env, and returns the function that moves both by a step."""
    network = RoadNetwork()
    network.add_lane("a", "b", StraightLane([0, 0], [9000, 0], speed_limit=33))
    road = Road(network)
    ego = IDMVehicle(road, [100, 0], speed=start["ego.speed"], target_speed=33, enable_lane_change=False)
    # Its cars are 5 m long, those of the world 4.54 m: the clearance is the same.
    ado = Vehicle(road, [100 + start["headway"] + LONGER_M, 0], speed=start["ado.speed"])
    road.vehicles = [ego, ado]

    def move(speed, step_s):
        before = ego.speed
        ado.act({"steering": 0.0, "acceleration": (speed - ado.speed) / step_s})
        ego.act()
        road.step(step_s)
        return ado.position[0] - ego.position[0] - LONGER_M, ego.speed, (ego.speed - before) / step_s

    return move


report("highway-env IDM", play(Ado(sys.argv[1]), begin))
