"""Worlds with several ados as PettingZoo environments: one policy per ado."""

from __future__ import annotations

import operator
import os
import warnings
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from brakecheck.envs import OPTIONS, Env, Frame
from brakecheck.errors import InputError
from brakecheck.worlds import World

try:
    from pettingzoo import ParallelEnv as PettingZooParallelEnv
except ImportError as error:  # pragma: no cover
    raise ImportError("`brakecheck.ParallelEnv` needs PettingZoo: pip install pettingzoo") from error

__all__ = ["ParallelEnv"]


class ParallelEnv(PettingZooParallelEnv[str, NDArray[np.float32], int]):  # type: ignore[misc]
    """A world whose ados act at the same time, each with its own actions.

    All ados get the observation and the reward of `Env`, because the rulebook judges
    their joint behaviour. The joint action counts the first ado fastest, as in `Env`.

    Args:
        world, plant, ego, seed, allow_programs, render_mode: as for `brakecheck.Env`.
    """

    metadata: dict[str, Any] = {**Env.metadata, "name": "brakecheck_v0"}

    def __init__(
        self, world: World | str | os.PathLike[str], *, render_mode: str | None = None, **kwargs: Any
    ) -> None:
        self._env = Env(world, render_mode=render_mode, **kwargs)
        self.world = self._env.world
        self.render_mode = render_mode
        self.metadata = {**self.metadata, **self._env.metadata}
        ados = self.world.about["ados"]
        self.possible_agents = [ado["name"] for ado in ados]
        self.agents: list[str] = []
        self.observation_spaces = {
            name: self._env.observation_space for name in self.possible_agents
        }
        self.action_spaces = {ado["name"]: spaces.Discrete(len(ado["actions"])) for ado in ados}

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Returns the observation space of an ado, which all ados share."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Returns the action space of an ado."""
        return self.action_spaces[agent]

    def joint(self, actions: dict[str, int]) -> int:
        """Returns the joint action of `Env` for your actions of all ados.

        Raises:
            InputError: an action is missing, or no integer of its `action_space`.
        """
        joint, weight = 0, 1
        for name in self.possible_agents:
            if name not in actions:
                raise InputError(f"no action of: {name}")
            count = int(self.action_spaces[name].n)
            try:
                action = operator.index(actions[name])
            except TypeError:
                action = -1
            if not 0 <= action < count:
                raise InputError(
                    f"{actions[name]!r} is no action of {name}: "
                    f"its actions are the integers 0 to {count - 1}"
                )
            joint += weight * action
            weight *= count
        return joint

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray[np.float32]], dict[str, dict[str, Any]]]:
        """Begins an episode, with seed and options as for `Env.reset`.

        Other options are left out with a warning, because PettingZoo's check passes some.
        """
        unknown = set(options or {}) - OPTIONS
        if options and unknown:
            warnings.warn(f"no option of `reset`: {', '.join(sorted(unknown))}", stacklevel=2)
            options = {name: value for name, value in options.items() if name in OPTIONS}
        obs, info = self._env.reset(seed=seed, options=options)
        self.agents = list(self.possible_agents)
        return {name: obs.copy() for name in self.agents}, {name: dict(info) for name in self.agents}

    def step(self, actions: dict[str, int]) -> tuple[
        dict[str, NDArray[np.float32]],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Takes an action of every ado."""
        obs, reward, terminated, truncated, info = self._env.step(self.joint(actions))
        agents = self.agents
        if terminated or truncated:
            self.agents = []
        return (
            {name: obs.copy() for name in agents},
            dict.fromkeys(agents, reward),
            dict.fromkeys(agents, terminated),
            dict.fromkeys(agents, truncated),
            {name: dict(info) for name in agents},
        )

    def trace(self) -> dict[str, NDArray[np.float64]]:
        """Returns the samples of the episode so far."""
        return self._env.trace()

    def render(self) -> Frame | list[Frame] | None:
        """Draws the current sample or a list of samples, as `Env.render` does."""
        return self._env.render()

    def close(self) -> None:
        """Does nothing, because no resource is open."""

    def __repr__(self) -> str:
        return f"<brakecheck.ParallelEnv {self.world.name!r}: {', '.join(self.possible_agents)}>"
