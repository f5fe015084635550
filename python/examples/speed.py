"""Cost of a step, in processor time of your machine: python3 speed.py

It measures environments with random actions, formulas over a million samples, and an
ego in Python. `cargo bench --bench stl` and `--bench plants` measure the same in Rust.
"""

import time

import numpy as np
from brakecheck import Env, VectorEnv
from brakecheck.stl import Formula

RNG = np.random.default_rng(0)


def seconds(work, tries=3):
    """Returns the least of some tries, in seconds of processor time."""
    taken = []
    for _ in range(tries):
        begun = time.process_time()
        work()
        taken.append(time.process_time() - begun)
    return min(taken)


def single(decisions, **options):
    env = Env("acc", plant="kinematic", **options)
    env.reset(seed=0)
    actions = RNG.integers(0, env.action_space.n, decisions).tolist()

    def play():
        for action in actions:
            *_, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    return seconds(play) / decisions


def vectorised(envs, steps):
    env = VectorEnv("acc", envs, plant="kinematic", copy=False)
    env.reset(seed=0)
    actions = RNG.integers(0, env.single_action_space.n, (steps, envs))

    def play():
        for each in actions:
            env.step(each)

    return seconds(play) / (steps * envs)


def formula(text, samples=1_000_000):
    signals = {"x": RNG.random(samples), "y": RNG.random(samples)}
    read = Formula(text)
    return seconds(lambda: read.robustness_all(signals, dt=0.1), 100) / samples


def say(what, value, unit):
    print(f"{what:52} {value:12,.2f} {unit}")


say("one environment", 1e-3 / single(100_000), "k decisions/s")
for envs in (16, 64, 512, 4096):
    say(f"{envs} environments in a vector", 1e-3 / vectorised(envs, 400_000 // envs), "k decisions/s")
calls = 0


def ego(percept):
    global calls
    calls += 1
    return 0.0


taken = 60_000 * single(20_000, ego=ego)  # of the three tries
say("an ego in Python, physics and its own code included", 1e6 * taken / calls, "µs/step")
for text in ("x > 0.5", "always[0, 5] (x > 0.5)", "always (x > 0.5 implies eventually[0, 3] (y > 0.5))"):
    say(text, 1e9 * formula(text), "ns/sample")
