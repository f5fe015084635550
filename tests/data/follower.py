"""Follower that is sound, or depends on more than its episode: follower.py KIND"""

import json
import os
import random
import signal
import sys
import time

KIND = sys.argv[1]
BEGAN = time.monotonic()
episodes = steps = total = 0
latched = False
mean = integral = previous = 0.0
near = last = None
rng = random.Random(1)


def follow(step):
    """Command and gap."""
    own = step["own"]
    ahead = [o for o in step["others"] if o["headway_m"] > 0.0 and abs(o["lateral_m"]) < 2.0]
    if not ahead:
        return 0.0, 99.0
    lead = min(ahead, key=lambda o: o["headway_m"])
    wish = lead["length_m"] + 2.0 + 0.6 * own["speed_mps"]
    accel = 0.25 * (lead["headway_m"] - wish) + lead["speed_mps"] - own["speed_mps"]
    return accel, lead["headway_m"] - lead["length_m"]


def command(step):
    global latched, mean, integral, previous, near, last
    accel, gap = follow(step)
    now = time.monotonic()
    match KIND:
        case "latch" | "cleared_latch":
            latched = latched or gap < 4.0
            accel = -7.0 if latched else accel
        case "limps" if gap < 3.0:
            near = episodes
        case "limps" if near is not None and 0 < episodes - near <= 3:
            accel = min(accel, 0.0) - 0.3
        case "learns_gap":
            mean += 0.0005 if accel < -1.0 else 0.0
            accel -= mean
        case "mean":
            mean += 0.1 * (accel - mean)
            accel = mean
        case "tired" if episodes > 6:
            accel *= 0.2
        case "old" if now - BEGAN > 0.15:
            accel -= 1.0
        case "counts_steps" if total > 600:
            accel -= 1.0
        case "alternates" if episodes % 2 == 0:
            accel -= 0.4
        case "cold" if episodes == 1 and steps < 20:
            accel = 0.0
        case "one_generator" | "seeded":
            accel += rng.uniform(-0.5, 0.5)
        case "random":
            accel += random.uniform(-0.5, 0.5)
        case "clock":
            integral += 0.3 * min(now - last, 0.2) if last else 0.0
            accel += 0.5 if integral > 0.2 else 0.0
        case "silence" if last:
            integral = max(integral, now - last)
            accel += 0.5 if integral > 0.4 else 0.0
        case "clock_rate" if last and steps > 1:
            accel += 0.001 * (accel - previous) / max(now - last, 1e-5)
    if KIND == "clock_rate":
        previous = accel
    last = now
    return max(-7.0, min(2.0, accel))


for line in sys.stdin:
    message = json.loads(line)
    if "hello" in message:
        if KIND == "loads":
            time.sleep(float(sys.argv[2]))
        answer = {"hello": {"protocol": 1, "name": KIND}}
    elif "reset" in message:
        answer = {"id": message["id"], "ready": True}
        episodes += 1
        steps = 0
        if KIND == "cleared_latch":
            latched = False
        if KIND == "seeded":
            rng = random.Random(message["reset"]["seed"])
        if KIND in ("clock", "silence"):
            integral, last = 0.0, None
    elif "step" in message:
        steps += 1
        total += 1
        if KIND == "hangs" and steps > 5:
            time.sleep(1000.0)
        if KIND == "unguarded" and steps > 5:
            os.kill(os.getpgrp(), signal.SIGKILL)
            time.sleep(1000.0)
        answer = {"id": message["id"], "accel_mps2": command(message["step"])}
    else:
        break
    print(json.dumps(answer), flush=True)
