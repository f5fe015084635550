#!/usr/bin/env python3
"""An ego in another language: JSON lines on stdin and stdout.

Name it in a world file:
    drive: Ego(Process(command: ["python3", "examples/ego.py"], lag_s: 0.2))
"""
import json
import sys

for line in sys.stdin:
    message = json.loads(line)
    if "reset" in message:
        print(json.dumps({"ready": True}), flush=True)
        continue
    own = message["own"]
    ahead = [o for o in message["others"] if o["headway_m"] > 0.0]
    accel = 0.0
    if ahead:
        lead = min(ahead, key=lambda o: o["headway_m"])
        wish = lead["length_m"] + 2.0 + 1.2 * own["speed_mps"]
        accel = 0.25 * (lead["headway_m"] - wish) + 1.0 * (lead["speed_mps"] - own["speed_mps"])
    print(json.dumps({"accel_mps2": max(-7.0, min(2.0, accel))}), flush=True)
