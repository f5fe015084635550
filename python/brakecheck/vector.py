"""Many environments at once, stepped in Rust on buffers that numpy owns."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv as GymnasiumVectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from brakecheck._brakecheck import RawEpisode, RawVector
from brakecheck.envs import checked_render_mode, rendered_in_real_time, spaces_of
from brakecheck.errors import InputError
from brakecheck.worlds import World

__all__ = ["VectorEnv"]


class _Episode(Mapping[str, Any]):
    """Info of an episode as in `Env`. Its first reading plays the episode again."""

    def __init__(self, raw: RawEpisode) -> None:
        self._raw = raw
        self._info: dict[str, Any] | None = None

    def _read(self) -> dict[str, Any]:
        if self._info is None:
            self._info = self._raw.info()
        return self._info

    def __getitem__(self, name: str) -> Any:
        return self._read()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._read())

    def __len__(self) -> int:
        return len(self._read())

    def __repr__(self) -> str:
        return repr(self._read())


class VectorEnv(GymnasiumVectorEnv[NDArray[np.float32], NDArray[np.int64], Any]):
    """Many environments of `brakecheck.Env`, each with its own stream of starts.

    After the end of an episode, the next step begins another episode for any action
    and returns no reward (Gymnasium's next-step autoreset). If episodes ended, `info`
    has `verdict`, `is_success`, `robustness`, `decisions` and `episode` (the info of
    `Env`), each beside a mask (`_verdict`, ...).

    Worlds of vehicles on the kinematic plant keep no traces, and need about 1 kB per
    environment. Their `episode` is a read-only mapping. `trace` plays the episode again.

    Args:
        world, plant, ego, allow_programs: as for `brakecheck.Env`.
        num_envs: number of environments.
        seed: seed of a `reset` without a seed.
        jobs: threads. 1 steps in your thread, and 0 takes a thread per core.
        copy: True returns new arrays from `step`. False returns the same buffers
            every time.
        render_mode: `"rgb_array"`, as for `brakecheck.Env`.
    """

    metadata: dict[str, Any] = {
        "render_modes": ["rgb_array"],
        "render_fps": 2.0,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        world: World | str | os.PathLike[str],
        num_envs: int = 1,
        *,
        plant: str | None = None,
        ego: Any = None,
        seed: int = 0,
        jobs: int = 1,
        copy: bool = True,
        allow_programs: bool = False,
        render_mode: str | None = None,
    ) -> None:
        self.render_mode = checked_render_mode(render_mode, self.metadata)
        if num_envs < 1:
            raise ValueError("a vector environment has one environment at least")
        changes = {"plant": plant, "ego": ego, "allow_programs": allow_programs}
        self.world = World.of(world, **changes)
        self.metadata = rendered_in_real_time(self.metadata, self.world, render_mode)
        self.num_envs = num_envs
        self._raw = RawVector(self.world._raw, num_envs, jobs)
        self._copy = copy
        self._seed: int | None = seed
        box, actions = spaces_of(self.world)
        self.single_observation_space, self.single_action_space = box, actions
        self.observation_space = batch_space(box, num_envs)
        self.action_space = batch_space(actions, num_envs)
        self._obs = np.zeros((num_envs, *box.shape), np.float32)
        self._rewards = np.zeros(num_envs, np.float64)
        self._terminated = np.zeros(num_envs, np.bool_)
        self._truncated = np.zeros(num_envs, np.bool_)

    def reset(
        self, *, seed: int | list[int] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins an episode in each environment.

        Args:
            seed: the i-th environment takes the stream of `seed + i`, or of the
                i-th seed of a list. Without a seed every stream continues.
            options: `purpose` of the streams, as for `Env.reset`.
        """
        super().reset(seed=seed if isinstance(seed, int) else None)
        seed = self._seed if seed is None else seed
        self._seed = None
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        if seeds is not None and len(seeds) != self.num_envs:
            raise ValueError(f"{len(seeds)} seeds for {self.num_envs} environments")
        purpose = (options or {}).get("purpose", "train")
        self._raw.reset(purpose, seeds, self._obs)
        return (self._obs.copy() if self._copy else self._obs), {}

    def step(
        self, actions: ArrayLike
    ) -> tuple[
        NDArray[np.float32],
        NDArray[np.float64],
        NDArray[np.bool_],
        NDArray[np.bool_],
        dict[str, Any],
    ]:
        """Takes a joint action in each environment, `[num_envs]`.

        Raises:
            InputError: the actions are no integers of `single_action_space`, or their
                number is wrong.
        """
        given = np.asarray(actions)
        # A cast would cut off what floats have behind the point.
        if given.dtype.kind not in "iu":
            raise InputError(f"actions of type {given.dtype} are no actions: give integers")
        if given.shape != (self.num_envs,):
            raise InputError(f"actions of shape {given.shape}: give one for each of {self.num_envs}")
        chosen = np.ascontiguousarray(given, np.int64)
        buffers = (self._obs, self._rewards, self._terminated, self._truncated)
        ended = self._raw.step(chosen, buffers)
        info = self._ended(ended) if ended else {}
        obs, rewards, terminated, truncated = buffers
        if self._copy:
            obs, rewards = obs.copy(), rewards.copy()
            terminated, truncated = terminated.copy(), truncated.copy()
        return obs, rewards, terminated, truncated, info

    def _ended(self, ended: list[int]) -> dict[str, Any]:
        mask = np.zeros(self.num_envs, np.bool_)
        mask[ended] = True
        info: dict[str, Any] = {
            "verdict": np.full(self.num_envs, None, object),
            "is_success": np.zeros(self.num_envs, np.bool_),
            "robustness": np.full(self.num_envs, np.nan),
            "decisions": np.zeros(self.num_envs, np.int64),
            "episode": np.full(self.num_envs, None, object),
        }
        names = list(info)
        verdicts, successes, robustness, decisions = zip(*self._raw.ended(ended))
        info["verdict"][ended] = np.array(verdicts, object)
        info["is_success"][ended] = successes
        info["robustness"][ended] = robustness
        info["decisions"][ended] = decisions
        for at, episode in zip(ended, self._raw.episodes(ended)):
            if isinstance(episode, RawEpisode):
                info["episode"][at] = _Episode(episode)
            else:
                info["episode"][at] = episode
        info.update({f"_{name}": mask for name in names})
        return info

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Draws the current sample of every environment, as `Env.render` does."""
        if self.render_mode is None:
            return None
        return tuple(self._raw.render(at) for at in range(self.num_envs))

    def trace(self, at: int) -> dict[str, NDArray[np.float64]]:
        """Returns the samples of the episode in the `at`-th environment."""
        return self._raw.trace(at)

    def __repr__(self) -> str:
        return f"<brakecheck.VectorEnv {self.world.name!r} × {self.num_envs}>"
