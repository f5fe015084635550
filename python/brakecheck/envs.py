"""Environments for Gymnasium, in which you train the ados against the ego."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any, SupportsIndex

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from brakecheck._brakecheck import RawBench
from brakecheck.worlds import World

__all__ = ["Env"]

Observation = NDArray[np.float32]
Frame = NDArray[np.uint8]

#: Options of `Env.reset`.
OPTIONS = {"purpose", "index", "start", "noise", "aftermath"}


class Env(gymnasium.Env[Observation, np.int64]):
    """A world under its rulebook, decision by decision.

    Your action is the joint action of all ados (`world.actions` has the words).
    An observation holds the signals of `world.observation`, each scaled so that its
    declared range is −1 .. 1. The reward arrives with the verdict (Definition 4), and is
    above 0 only if the ego failed with every rule kept.

    `terminated` is the end of an episode. It includes the horizon, which is part of
    the problem. `truncated` means that the ego or the physics failed, so that you
    cannot use the episode. The last `info` holds

    - `verdict`: counterexample, uncounted, held, foul or invalid.
    - `is_success`, `robustness` (ρ of the ego's specification), `rules` (ρ of
      each rule), `broken_rule`.
    - `contact`: bodies, time and speed, or None.
    - `fault`: reason of an invalid episode, or None.
    - `decisions` and `time_s`.

    Args:
        world: a world, the path of a `.ron` file, or the name of a shipped one.
        plant: `"kinematic"` or `"rigid"`, instead of the file's.
        ego: the ego to test, as for `World`.
        seed: seed of the stream of starts, for a `reset` without a seed.
        allow_programs: start the programs that the file names as egos.
        render_mode: `"rgb_array"` lets `render` draw the current sample, and
            `"rgb_array_list"` every sample since its last call. A frame per decision,
            or all frames of a list, play in real time at `metadata["render_fps"]`.
    """

    metadata: dict[str, Any] = {
        "render_modes": ["rgb_array", "rgb_array_list"],
        "render_fps": 2.0,
    }

    def __init__(
        self,
        world: World | str | os.PathLike[str],
        *,
        plant: str | None = None,
        ego: Any = None,
        seed: int = 0,
        allow_programs: bool = False,
        render_mode: str | None = None,
    ) -> None:
        self.render_mode = checked_render_mode(render_mode, self.metadata)
        changes = {"plant": plant, "ego": ego, "allow_programs": allow_programs}
        self.world = World.of(world, **changes)
        self._bench = RawBench(self.world._raw, render_mode == "rgb_array_list")
        self._stream = ("train", seed, 0)
        self.metadata = rendered_in_real_time(self.metadata, self.world, render_mode)
        box, actions = spaces_of(self.world)
        self.observation_space: spaces.Box = box  # type: ignore[assignment]
        self.action_space = actions

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begins an episode.

        Args:
            seed: begins the stream of starts of this seed. Without a seed the
                stream continues.
            options: `purpose` ("train", "calibration", or "test" for the starts on
                which `eval` reports), `index` (position in the stream), `start`
                (a value per axis of `world.about["axes"]`, by name or in their
                order) with `noise` (its seed), `aftermath` (continues after a success,
                to contact or the horizon).
        """
        super().reset(seed=seed)
        options = options or {}
        unknown = set(options) - OPTIONS
        if unknown:
            raise ValueError(f"no option of `reset`: {', '.join(sorted(unknown))}")
        aftermath = bool(options.get("aftermath", False))
        if "start" in options:
            start = self._start(options["start"])
            obs = self._bench.reset_at(start, int(options.get("noise", 0)), aftermath)
            return obs, self._bench.info()
        purpose, of, index = self._stream
        if seed is not None:
            of, index = seed, 0
        purpose = options.get("purpose", purpose)
        index = int(options.get("index", index))
        obs = self._bench.reset((purpose, of, index), aftermath)
        self._stream = (purpose, of, index + 1)
        return obs, self._bench.info()

    def _start(self, given: Mapping[str, float] | Iterable[float]) -> list[float]:
        if not isinstance(given, Mapping):
            return [float(value) for value in given]
        names = [axis["name"] for axis in self.world.about["axes"]]
        if set(given) != set(names):
            raise ValueError(f"a start of this world has a value for each of: {', '.join(names)}")
        return [float(given[name]) for name in names]

    def step(
        self, action: SupportsIndex
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Takes a joint action and plays to the next decision or the verdict.

        Raises:
            InputError: the action is no integer of `action_space`, or no episode began.
        """
        obs, reward, terminated, truncated = self._bench.step(action)
        info = self._bench.info() if terminated or truncated else {}
        return obs, reward, terminated, truncated, info

    def render(self) -> Frame | list[Frame] | None:  # type: ignore[override]
        """Draws the current sample from above, `[288, 896, 3]`.

        With `"rgb_array_list"` you get every sample since the last call or `reset`, and
        without a `render_mode` None. The ego drives to the right, at a fixed place of
        the picture and a fixed scale.
        """
        if self.render_mode == "rgb_array_list":
            return self._bench.render_samples()
        return None if self.render_mode is None else self._bench.render()

    def trace(self) -> dict[str, NDArray[np.float64]]:
        """Returns the samples of the episode so far: `time` in seconds, and every signal."""
        return self._bench.trace()

    def __repr__(self) -> str:
        return f"<brakecheck.Env {self.world.name!r}: {self.action_space}, {self.observation_space}>"


def checked_render_mode(mode: str | None, metadata: dict[str, Any]) -> str | None:
    """Returns a render mode after a check."""
    known = metadata["render_modes"]
    if mode is not None and mode not in known:
        raise ValueError(f"`render_mode={mode!r}` is not known; known: {', '.join(known)}")
    return mode


def rendered_in_real_time(
    metadata: dict[str, Any], world: World, mode: str | None
) -> dict[str, Any]:
    """Returns the metadata with the rate at which frames of a mode play in real time."""
    between = "sample_s" if mode == "rgb_array_list" else "decision_s"
    return {**metadata, "render_fps": 1.0 / float(world.about[between])}


def spaces_of(world: World) -> tuple[spaces.Box, spaces.Discrete]:
    """Returns the spaces of the joint observation, `[observed signals]`, and the joint action.

    Observations are scaled, not clipped. A signal outside its declared range is
    outside −1 .. 1 as well.
    """
    shape = (len(world.observation),)
    box = spaces.Box(-np.inf, np.inf, shape, np.float32)
    return box, spaces.Discrete(len(world.actions))
