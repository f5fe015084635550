#!/usr/bin/env python3
"""A sampling planner of fiss-planner as an ego: pip install fiss-planner

    brakecheck eval runs/acc -- python3 examples/egos/fiss.py
    brakecheck eval runs/acc -- python3 examples/egos/fiss.py fop cost.desired_time_headway=1.0

The first word is fiss_plus (Sun et al., IROS 2023), fiss (Sun et al., RA-L 2022), fop_plus or fop (Werling
et al., ICRA 2010); the others are settings of its PlannerConfig. It drives as in the package's own CARLA
example, in one lane: ten plans a second among others of constant velocity, each stitched to the one
before, its own fallbacks, its Stanley controller for what lies between. fiss-planner is Apache-2.0.
"""
import sys

import fiss_planner as fp
from protocol import serve

kind, words = (sys.argv[1:] or ["fiss_plus"])[0], dict(word.split("=") for word in sys.argv[2:])
ROAD_M, MOST_MPS, PLAN_S = 5_000, 33.0, 0.1
car, config = fp.VehicleParams(), fp.LocalPlannerConfig()
car.max_speed = config.desired_speed = MOST_MPS
config.path.num_left_lanes = config.path.num_right_lanes = 0
config.planner.collision.ignore_rear_in_lane = True
config.planner.type = fp.planner_type_from_string(kind)
for name, value in words.items():
    part, _, last = name.rpartition(".")
    holder = getattr(config.planner, part, None)
    if not hasattr(holder, last):
        sys.exit(f"PlannerConfig of fiss-planner has no {name}")
    setattr(holder, last, type(getattr(holder, last))(float(value)))
config.planner.validate()
planner = fp.LocalPlanner(config, car)
planner.set_reference_path(list(range(-100, ROAD_M, 5)), [0] * len(range(-100, ROAD_M, 5)))
now = {}


def reset(message):
    planner.reset()
    now.update(tracker=fp.make_controller("stanley_pid", car), plan=None, since_s=-1.0)


def predicted(number, other, own):
    """From the middle of a body, as the planner has it; ours are of its front bumper."""
    x_m = own["s_m"] + other["headway_m"] - other["length_m"] / 2
    return fp.predict_constant_velocity(number, x_m, other["lateral_m"], 0.0, other["speed_mps"], other["length_m"],
                                        other["width_m"], config.planner.sampling.max_t + 0.5, 0.1)


def control(step):
    own, time_s = step["own"], step["time_s"]
    rear_axle_m = own["s_m"] - own["length_m"] / 2 - car.rear_axle_to_center
    ego = fp.EgoState(rear_axle_m, 0.0, 0.0, own["speed_mps"], own["accel_mps2"])
    if time_s > now["since_s"] + PLAN_S - 1e-6:
        plan = planner.step(time_s, ego, [predicted(i, other, own) for i, other in enumerate(step["others"])]).trajectory
        if len(plan) > 1:
            now.update(plan=plan, since_s=time_s)
    wish = now["tracker"].compute(ego, now["plan"], time_s - now["since_s"]).accel if now["plan"] else -car.max_decel
    return min(max(wish, -car.max_decel), car.max_accel)


serve(f"fiss-planner {kind}", reset, control)
