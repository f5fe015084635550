#!/usr/bin/env python3
"""The IDM of highway-env as an ego: pip install highway-env

    brakecheck eval runs/acc -- python3 examples/egos/highway.py
    brakecheck eval runs/acc -- python3 examples/egos/highway.py TIME_WANTED=0.8 DISTANCE_WANTED=1

Words are constants of its IDMVehicle (TIME_WANTED, DISTANCE_WANTED, COMFORT_ACC_MAX,
COMFORT_ACC_MIN, ACC_MAX, DELTA). highway-env is MIT; nothing of it is here.
"""
import sys

import numpy as np
from highway_env.road.lane import StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle
from protocol import lead_of, serve

for word in sys.argv[1:]:
    name, value = word.split("=")
    if not hasattr(IDMVehicle, name):
        sys.exit(f"IDMVehicle of highway-env has no {name}")
    setattr(IDMVehicle, name, float(value))

network = RoadNetwork()
network.add_lane("a", "b", StraightLane([0, 0], [100_000, 0], speed_limit=33))
road = Road(network)
ego = IDMVehicle(road, [0, 0], target_speed=33, enable_lane_change=False)
other = Vehicle(road, [0, 0])


def control(step):
    """What IDMVehicle.act does in its lane, without its own move."""
    own, lead = step["own"], lead_of(step)
    # Its positions are of the middle of a car, and all cars are equally long.
    ego.position, ego.speed = np.array([0.0, 0.0]), own["speed_mps"]
    if lead:
        gap_m = lead["headway_m"] - lead["length_m"]
        other.position, other.speed = np.array([gap_m + Vehicle.LENGTH, 0.0]), lead["speed_mps"]
    accel = ego.acceleration(ego_vehicle=ego, front_vehicle=other if lead else None)
    return np.clip(accel, -ego.ACC_MAX, ego.ACC_MAX)


serve("highway-env IDM", lambda message: None, control)
