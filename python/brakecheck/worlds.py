"""Worlds: a road, an ego with its specification, ados and their rules."""

from __future__ import annotations

import json
import os
from typing import Any

from brakecheck._brakecheck import RawWorld

__all__ = ["World"]


class World:
    """A world file, checked.

    Args:
        file: the path of a `.ron` file, or the name of a shipped world
            (`World.shipped()`).
        plant: `"kinematic"` or `"rigid"`, instead of the file's.
        ego: the ego to test: a name under the file's `reuse`, a RON file with a
            `Change`, the words of a program as a list, or your Python code: a
            function of a percept, or a class or an object with `reset(seed)` and
            `control(percept)`.
        allow_programs: start the programs that the file names as egos.
        natural: limits ados to braking, accelerations and cut-ins that real
            drivers show at least this often per 1,000 km.
        traffic: the model of real drivers: `"motorway"`, or a file of
            `brakecheck log --fit`.

    Raises:
        InputError: the file is no world. The message has the place and the reason.
    """

    def __init__(
        self,
        file: str | os.PathLike[str],
        *,
        plant: str | None = None,
        ego: Any = None,
        allow_programs: bool = False,
        natural: float | None = None,
        traffic: str | os.PathLike[str] | None = None,
    ) -> None:
        self.file = os.fspath(file)
        self._given = {
            "plant": plant,
            "ego": ego,
            "allow_programs": allow_programs,
            "natural": natural,
            "traffic": traffic,
        }
        #: The file's own world, from which test starts and egos are taken.
        self._nominal = RawWorld.load(self.file, allow_programs)
        if natural is not None or traffic is not None:
            named = None if traffic is None else os.fspath(traffic)
            self._nominal = self._nominal.in_traffic(named, natural)
        if plant is not None:
            self._nominal = self._nominal.with_parts(plant, None)
        self._raw = self._nominal if ego is None else self._nominal.with_parts(None, ego)
        self.ego = ego
        self._about: dict[str, Any] = self._raw.about()

    @staticmethod
    def shipped() -> list[str]:
        """Returns the names of the worlds in the package."""
        return RawWorld.shipped()

    @classmethod
    def of(cls, world: World | str | os.PathLike[str], **changes: Any) -> World:
        """Returns a world as it is, or the world of a file or name."""
        if isinstance(world, World):
            asked = {name: value for name, value in changes.items() if value not in (None, False)}
            return cls(world.file, **{**world._given, **asked}) if asked else world
        return cls(world, **changes)

    @classmethod
    def write(cls, value: dict[str, Any], file: str | os.PathLike[str], **changes: Any) -> World:
        """Writes a world that you built or changed as a value, and returns it, checked.

        `value` has the form of `brakecheck check --schema`, as `World.value` has. A file that
        exists is replaced, and a value that is no world writes nothing.
        """
        text = RawWorld.text_of(json.dumps(value))
        RawWorld.parse(os.fspath(file), text)
        with open(file, "w", encoding="utf-8") as written:
            written.write(text)
        return cls(file, **changes)

    @property
    def value(self) -> dict[str, Any]:
        """The world as dictionaries and lists, in the form of `brakecheck check --schema`."""
        return dict(json.loads(self._raw.value()))

    @property
    def name(self) -> str:
        """Its name, which is part of every start's key."""
        return str(self._about["name"])

    @property
    def question(self) -> str:
        """The question it asks."""
        return str(self._about["question"])

    @property
    def text(self) -> str:
        """The text of the file."""
        return self._raw.text

    @property
    def egos(self) -> list[str]:
        """Names of the changed egos under the file's `reuse`."""
        return list(self._about["egos"])

    @property
    def about(self) -> dict[str, Any]:
        """Signals, rules, actions, observation, axes, clocks: as `check --json`."""
        return self._about

    @property
    def actions(self) -> list[str]:
        """The joint actions in words."""
        return list(self._about["actions"])

    @property
    def observation(self) -> list[dict[str, Any]]:
        """Observation of the ados: name, unit, and the range that is scaled to −1 .. 1."""
        return list(self._about["observation"])

    def __repr__(self) -> str:
        about = self._about
        ego = about["own_ego"] or "nominal"
        return (
            f"<World {self.name!r}: {self.question} {len(about['actions'])} actions, "
            f"{len(about['rules'])} rules, {about['plant']}, ego {ego}>"
        )
