#!/usr/bin/env python3
"""An ado of Stable-Baselines3, measured like an ado of brakecheck.

Run pip install stable-baselines3 first. You need a few minutes of a core.

    python3 sb3_ado.py ppo 0        # or dqn, and a seed
"""
import sys
import time

import torch
from brakecheck import Env, eval
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.env_util import make_vec_env

DECISIONS = 600_000
torch.set_num_threads(1)


def falling(first, last):
    """Returns a rate that falls linearly, with `left` from 1 at the start to 0 at the end."""
    return lambda left: last + left * (first - last)


def learner(name, seed):
    # Each environment draws its own stream of training starts. What is paid comes
    # once, at the end of an episode: nothing is discounted.
    envs = 32 if name == "ppo" else 8
    env = make_vec_env(lambda: Env("acc", plant="kinematic"), envs, seed=1000 * seed)
    if name == "ppo":
        return PPO("MlpPolicy", env, n_steps=256, batch_size=1024, gamma=1.0, gae_lambda=0.98,
                   ent_coef=0.01, learning_rate=falling(1e-3, 1e-4), seed=seed)
    return DQN("MlpPolicy", env, gamma=1.0, learning_rate=falling(1e-3, 5e-5), buffer_size=DECISIONS, batch_size=128,
               gradient_steps=envs // 2, target_update_interval=envs, tau=0.02, exploration_fraction=0.5,
               learning_starts=5_000, seed=seed)


if __name__ == "__main__":
    name, seed = sys.argv[1], int(sys.argv[2])
    model = learner(name, seed)
    model.learn(DECISIONS)
    seconds = time.process_time()
    print(eval("acc", ado=model, plant="kinematic", search=1, name=f"sb3 {name}"))
    print(f"{seconds:.0f} s of processor time for {DECISIONS} decisions")
