#!/usr/bin/env python3
"""An ego in another language: ego protocol 1, JSON lines on stdin and stdout.

Name it in a world file:
    drive: Ego(Process(command: ["python3", "examples/ego.py"], lag_s: 0.2)),
and try it against the protocol:
    brakecheck check -- python3 examples/ego.py
"""
import json
import sys


def follow(step):
    """Keeps 1.2 s behind whoever is ahead in the same lane."""
    own = step["own"]
    ahead = [o for o in step["others"] if o["headway_m"] > 0.0 and abs(o["lateral_m"]) < 2.0]
    if not ahead:
        return 0.0
    lead = min(ahead, key=lambda o: o["headway_m"])
    wish = lead["length_m"] + 2.0 + 1.2 * own["speed_mps"]
    accel = 0.25 * (lead["headway_m"] - wish) + 1.0 * (lead["speed_mps"] - own["speed_mps"])
    return max(-7.0, min(2.0, accel))


for line in sys.stdin:
    message = json.loads(line)
    if "hello" in message:
        answer = {"hello": {"protocol": 1, "name": "follower"}}
    elif "reset" in message:
        answer = {"id": message["id"], "ready": True}
    elif "step" in message:
        answer = {"id": message["id"], "accel_mps2": follow(message["step"])}
    elif "close" in message:
        break
    else:
        continue
    print(json.dumps(answer), flush=True)
