"""Steps of environments: brakecheck in three sizes, and highway-env."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from brakecheck import Env, VectorEnv
from timing import least

RNG = np.random.default_rng(0)
#: Decisions of a run.
DECISIONS = {"kinematic": 80_000, "rigid": 12_288}
#: Steps before the first run, which spread out the ends of episodes that begin together.
WARM_UP = {"kinematic": 40, "rigid": 8}
HIGHWAYS = {"highway-fast-v0": 120, "highway-v0": 12}
#: Seconds of a decision in `acc`, and of a step in highway-env.
ACC_S, HIGHWAY_S = 0.5, 1.0
ACC_VEHICLES = 2


def single(env: Any, decisions: int) -> Callable[[], float]:
    """A run of one environment with random actions."""
    env.reset(seed=0)
    actions = RNG.integers(0, env.action_space.n, decisions).tolist()

    def run() -> float:
        for action in actions:
            *_, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return decisions

    return run


def vector(plant: str, envs: int, decisions: int) -> Callable[[], float]:
    """A run of a vector of environments with random actions."""
    env = VectorEnv("acc", envs, plant=plant, copy=False)
    env.reset(seed=0)
    for _ in range(WARM_UP[plant]):
        env.step(RNG.integers(0, env.single_action_space.n, envs))
    steps = max(decisions // envs, 1)
    actions = RNG.integers(0, env.single_action_space.n, (steps, envs))

    def run() -> float:
        resets = 0
        for each in actions:
            *_, info = env.step(each)
            # The next step of an ended episode resets it and decides nothing.
            resets += int(info["_verdict"].sum()) if info else 0
        return steps * envs - resets

    return run


def ours() -> dict[str, dict[str, float]]:
    """Decisions per CPU-s, by plant and by environment."""
    found = {}
    for plant, decisions in DECISIONS.items():
        works = {"Env": single(Env("acc", plant=plant), decisions)}
        for envs in (1, 64, 4096):
            works[f"VectorEnv({envs})"] = vector(plant, envs, decisions)
        found[plant] = {name: 1 / cost for name, cost in least(works).items()}
    return found


def highways() -> list[dict[str, Any]] | None:
    """Steps per CPU-s of highway-env beside `Env`, or None if it is missing."""
    try:
        import gymnasium
        import highway_env  # noqa: F401
    except ImportError:
        return None
    found = []
    for name, steps in HIGHWAYS.items():
        env = gymnasium.make(name)
        env.reset(seed=0)
        vehicles = len(env.unwrapped.road.vehicles)
        acc = Env("acc", plant="kinematic")
        works = {"ours": single(acc, DECISIONS["kinematic"]), "theirs": single(env, steps)}
        rates = {side: 1 / cost for side, cost in least(works).items()}
        seconds = {"ours": ACC_VEHICLES * ACC_S, "theirs": vehicles * HIGHWAY_S}
        moved = {side: rates[side] * seconds[side] for side in rates}
        config = env.unwrapped.config
        hertz = config["simulation_frequency"]
        assert config["policy_frequency"] * HIGHWAY_S == 1, config
        found.append(
            {"name": name, "vehicles": vehicles, "hertz": hertz, "steps": rates, "moved": moved}
        )
    return found
