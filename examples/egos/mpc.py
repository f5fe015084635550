#!/usr/bin/env python3
"""A longitudinal model predictive controller as an ego: pip install numpy

    brakecheck eval runs/acc -- python3 examples/egos/mpc.py
    brakecheck eval runs/acc -- python3 examples/egos/mpc.py time_gap_s=0.8 brake_mps2=3.5

The formulation of Li, Li, Rajamani and Wang 2011, Model predictive multi-objective vehicular
adaptive cruise control, IEEE Trans. Control Systems Technology 19 (3): a quadratic program over
the ego's jerk with soft distances, condensed; every 0.2 s for 4.8 s, behind a lead whose acceleration
decays. Words are keys of `is_`; their values, and how the program is solved, are not of that paper.
"""
import sys

import numpy as np
from protocol import lead_of, serve

is_ = {"time_gap_s": 1.2, "standstill_m": 4.0, "safe_m": 1.0, "set_mps": 33.0, "brake_mps2": 5.0,
       "accel_mps2": 2.0, "jerk_mps3": 5.0, "lead_decay_s": 1.5}
given = dict(word.split("=") for word in sys.argv[1:])
if not set(given) <= set(is_):
    sys.exit(f"there is no {min(set(given) - set(is_))}, only {', '.join(is_)}")
gap_s, stop_m, safe_m, set_mps, least, most, jerk, decay_s = (float(x) for x in (is_ | given).values())

STEPS, STEP_S, REPLAN_S, FINE = 16, 0.3, 0.2, 8
at_s, fine_s, one = STEP_S * np.arange(1, STEPS + 1), STEP_S / FINE * np.arange(1, FINE * STEPS + 1), np.eye(STEPS)
m = np.maximum(np.subtract.outer(np.arange(1, STEPS + 1), np.arange(STEPS)), 0)  # steps since that jerk began
a_of, v_of, x_of = STEP_S * (m > 0), STEP_S**2 * (m - (m > 0) / 2), STEP_S**3 * (m**2 / 2 - m / 2 + (m > 0) / 6)
# What costs its square (speed, acceleration, jerk), and what only above 0 (distances, reversing, limits).
square = np.vstack([0.3 * v_of, 0.5 * a_of, one])
above = np.vstack([x_of + gap_s * v_of, 10 * x_of, -10 * v_of, 30 * a_of, -30 * a_of, 30 * one, -30 * one])
plan = {}


def solve(b, d):
    """The jerks j of least |square j + b|² + |max(above j + d, 0)|²: Newton on the active set."""
    j, active = np.zeros(STEPS), None
    for _ in range(12):
        before, active = active, above @ j + d > 0
        if np.array_equal(before, active):
            break
        j = -np.linalg.solve(square.T @ square + above[active].T @ above[active], square.T @ b + above[active].T @ d[active])
    return j


def control(step):
    if plan["until_s"] <= step["time_s"] + 1e-9:
        lead, a, now_mps, free_m = lead_of(step), plan["accel_mps2"], step["own"]["speed_mps"], 1e3
        v, x = now_mps + a * at_s, now_mps * at_s + a * at_s**2 / 2
        if lead:
            its_mps = np.maximum(lead["speed_mps"] + lead["ax_mps2"] * decay_s * (1 - np.exp(-fine_s / decay_s)), 0)
            free_m = lead["headway_m"] - lead["length_m"] + np.cumsum(its_mps)[FINE - 1 :: FINE] * fine_s[0]
        limits = 30 * np.repeat([a - most, -a - least, -jerk, -jerk], STEPS)
        b = np.concatenate([0.3 * (v - set_mps), np.full(STEPS, 0.5 * a), 0 * v])
        d = np.concatenate([x + gap_s * v + stop_m - free_m, 10 * (x + safe_m - free_m), -10 * v, limits])
        plan.update(jerk=np.clip(solve(b, d)[0], -jerk, jerk), until_s=step["time_s"] + REPLAN_S)
    plan["accel_mps2"] = float(np.clip(plan["accel_mps2"] + plan["jerk"] * step["sample_s"], -least, most))
    return plan["accel_mps2"]


serve("MPC", lambda message: plan.update(until_s=0.0, accel_mps2=0.0), control)
