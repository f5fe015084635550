"""Deep Q-learning: `brakecheck train` beside Stable-Baselines3 on the same environment."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from typing import Any

from brakecheck import Env
from timing import least

#: Decisions and runs by plant.
TRAININGS = {"kinematic": (60_000, 2), "rigid": (10_000, 2)}


def ours(plant: str, decisions: int) -> float:
    """Decisions per CPU-s that `train` prints."""
    with tempfile.TemporaryDirectory() as directory:
        command = [sys.executable, "-m", "brakecheck", "train", "acc", "--plant", plant]
        command += ["--decisions", str(decisions), "--starts", "1", "--jobs", "1", "--json"]
        ran = subprocess.run(
            [*command, "--output", f"{directory}/run"], stdout=subprocess.PIPE, text=True, check=True
        )
    return json.loads(ran.stdout)["decisions_per_cpu_s"]


def theirs(plant: str, decisions: int) -> float:
    """Trains with the sizes of recipe R, and returns the number of decisions."""
    from stable_baselines3 import DQN

    model = DQN(
        "MlpPolicy",
        Env("acc", plant=plant),
        policy_kwargs={"net_arch": [64, 64]},
        learning_rate=1e-3,
        buffer_size=decisions,
        learning_starts=1000,
        batch_size=64,
        train_freq=2,
        gradient_steps=1,
        target_update_interval=1,
        tau=0.005,
        gamma=1.0,
        device="cpu",
        seed=0,
    )
    model.learn(decisions)
    return decisions


def trainings() -> list[dict[str, Any]]:
    """Decisions per CPU-s by plant, where `theirs` is None without Stable-Baselines3."""
    try:
        import stable_baselines3  # noqa: F401
        import torch

        torch.set_num_threads(1)
        has_rival = True
    except ImportError:
        has_rival = False
    found = []
    for plant, (decisions, tries) in TRAININGS.items():
        own, other = [], []
        for _ in range(tries):
            own.append(ours(plant, decisions))
            if has_rival:
                work = {"theirs": lambda: theirs(plant, decisions)}
                other.append(1 / least(work, 1)["theirs"])
        fastest = max(other) if has_rival else None
        found.append({"plant": plant, "decisions": decisions, "ours": max(own), "theirs": fastest})
    return found
