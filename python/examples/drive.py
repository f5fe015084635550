"""Plays the ado of `acc` and its baselines in your simulator.

Your simulator is a function `begin(start, step_s)`, which puts ego and ado on its
road and returns `move(ado_speed_mps, step_s)`. This function makes a step, and returns
the headway from front to front in m, the ego's speed in m/s and acceleration in m/s².
"""
import random

from brakecheck import Env

STARTS = 100


def starts(world):
    """Yields the test starts of the world, by signal."""
    env = Env(world)
    for index in range(STARTS):
        env.reset(seed=0, options={"purpose": "test", "index": index})
        yield {name: float(column[-1]) for name, column in env.trace().items()}


def episode(world, begin, start, choose):
    """Returns `"contact"`, `"too near"` (the ego's specification), `"foul"` or `"held"`."""
    about, seen, near = world.about, dict(start), False
    step_s, move = about["sample_s"], begin(start, about["sample_s"])
    for sample in range(round(about["horizon_s"] / step_s)):
        seen["time_left"] = about["horizon_s"] - sample * step_s
        if sample % round(about["decision_s"] / step_s) == 0:
            accel = choose(seen)
        seen["ado.speed"] += accel * step_s
        if not near and not 0.1 <= seen["ado.speed"] <= 30:
            return "foul"  # its rules hold until the ego has failed, as at home
        seen["headway"], seen["ego.speed"], seen["ego.accel"] = move(max(seen["ado.speed"], 0.0), step_s)
        near = near or seen["headway"] < 4.7
        if seen["headway"] <= 4.54:
            return "contact"
    return "too near" if near else "held"


def play(ado, begin):
    """Returns the outcomes of the trained ado, of constant and of held random actions."""
    drawn = random.Random(0)
    accels = [command["ado"]["accel_mps2"] for command in ado.world.about["commands"]]

    def held_at_random(seen, memory={}):
        if memory.setdefault("left", 0) == 0:
            memory.update(left=5, accel=drawn.choice(accels))
        memory["left"] -= 1
        return memory["accel"]

    who = {
        "trained": lambda seen: ado.command(seen)["ado"]["accel_mps2"],
        "held at random": held_at_random,
        "brakes": lambda seen: min(accels),
        "keeps its speed": lambda seen: 0.0,
    }
    ends = {}
    for name, choose in who.items():
        ends[name] = [episode(ado.world, begin, start, choose) for start in starts(ado.world)]
    return ends


def report(ego, ends):
    for name, ended in ends.items():
        counted = ", ".join(f"{word} {ended.count(word):3d}" for word in ("contact", "too near", "foul", "held"))
        print(f"{ego:16} {name:16} {counted}")
