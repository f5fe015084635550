"""A follower that declares its parameters, so that `brakecheck harden` can change them.

    brakecheck harden acc --traffic examples/traffic/acc.ron -- python3 examples/egos/tunable.py
"""
from protocol import lead_of, serve

#: Name, least value, greatest value, default.
PARAMETERS = [
    ("time_gap_s", 0.3, 2.0, 0.5),
    ("closing_gain_per_s", 0.3, 2.0, 1.0),
    ("gap_gain_per_s2", 0.05, 0.6, 0.3),
]
values = {}


def reset(message):
    values.update(message["parameters"])


def control(step):
    own, lead = step["own"], lead_of(step)
    if lead is None:
        return 0.0
    wanted_m = lead["length_m"] + 1.2 + values["time_gap_s"] * own["speed_mps"]
    gap = values["gap_gain_per_s2"] * (lead["headway_m"] - wanted_m)
    closing = values["closing_gain_per_s"] * (lead["speed_mps"] - own["speed_mps"])
    return max(-6.0, min(2.5, gap + closing))


serve("tunable", reset, control, PARAMETERS)
