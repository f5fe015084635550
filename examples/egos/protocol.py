"""Ego protocol 1, so that a program only says what it does: JSON lines on stdin and stdout."""
import json
import os
import sys

# Answers go where brakecheck listens; what a library prints goes to stderr.
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)


def serve(name, reset, control, parameters=()):
    """Answers until brakecheck is done.

    `reset(message)` begins an episode, `control(step)` gives the acceleration in m/s²;
    what they raise is reported as the ego's fault. `parameters` has the name, least value,
    greatest value and default of each parameter, whose values are `message["parameters"]`.
    """
    for line in sys.stdin:
        message = json.loads(line)
        if "close" in message:
            break
        answer = {"id": message.get("id")}
        try:
            if "hello" in message:
                declared = [dict(zip(("name", "lo", "hi", "default"), one)) for one in parameters]
                answer = {"hello": {"protocol": 1, "name": name, "parameters": declared}}
            elif "reset" in message:
                reset(message["reset"])
                answer["ready"] = True
            elif "step" in message:
                answer["accel_mps2"] = float(control(message["step"]))
            else:
                continue
        except Exception as error:  # any: it is the ego's, and brakecheck shows it
            answer["error"] = f"{type(error).__name__}: {error}"
        print(json.dumps(answer), file=answers, flush=True)


def lead_of(step):
    """Whoever is ahead in the ego's path, the nearest one; `None`: nobody is."""
    own = step["own"]
    beside = lambda other: abs(other["lateral_m"]) - 0.5 * (other["width_m"] + own["width_m"])
    ahead = [other for other in step["others"] if 0.0 < other["headway_m"] and beside(other) < 0.2]
    return min(ahead, key=lambda other: other["headway_m"], default=None)
