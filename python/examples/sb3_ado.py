#!/usr/bin/env python3
"""An ado by Stable-Baselines3, measured as brakecheck's own: pip install stable-baselines3

    python3 sb3_ado.py dqn          # or ppo; minutes of one core
"""
import sys
import time

import torch
from brakecheck import Env, eval
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.env_util import make_vec_env

DECISIONS, ENVS = 600_000, 32
torch.set_num_threads(1)


def falling(first, last):
    """A rate that falls linearly; `left` is 1 at the start and 0 at the end."""
    return lambda left: last + left * (first - last)


def learner(name):
    # Each environment draws its own stream of training starts. What is paid comes
    # once, at the end of an episode: nothing is discounted, and returns are long.
    env = make_vec_env(lambda: Env("acc", plant="kinematic"), ENVS, seed=0)
    if name == "ppo":
        return PPO("MlpPolicy", env, n_steps=256, batch_size=1024, gamma=1.0, gae_lambda=0.98,
                   ent_coef=0.01, learning_rate=falling(1e-3, 1e-4), seed=0)
    return DQN("MlpPolicy", env, gamma=1.0, n_steps=3, learning_rate=falling(1e-3, 5e-5), buffer_size=DECISIONS,
               gradient_steps=ENVS // 4, batch_size=128, target_update_interval=ENVS, tau=0.03,
               exploration_fraction=0.25, learning_starts=5_000, seed=0)


if __name__ == "__main__":
    model = learner(sys.argv[1])
    model.learn(DECISIONS)
    seconds = time.process_time()
    print(eval("acc", ado=model, plant="kinematic", search=1, name=f"sb3 {sys.argv[1]}"))
    print(f"{seconds:.0f} s of processor time for {DECISIONS} decisions")
