"""Recorded traffic from arrays, as `brakecheck log` takes it from files.

>>> import numpy as np
>>> from brakecheck import Recording
>>> t = np.arange(100) / 10
>>> recording = Recording(np.repeat("a", 100), t, 20 * t, np.zeros(100))
>>> recording.summary()["road_users"]
1
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brakecheck._brakecheck import RawRecording, RawWorld
from brakecheck._brakecheck import fit_traffic as fit_raw
from brakecheck.errors import InputError
from brakecheck.worlds import World

__all__ = ["Recording", "fit_traffic"]


def _numbers(name: str, values: ArrayLike) -> NDArray[np.float64]:
    try:
        array = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"`{name}` is no array of numbers: {error}") from None
    if array.ndim != 1:
        raise InputError(f"`{name}` has {array.ndim} dimensions, not 1")
    return array


def _texts(name: str, values: ArrayLike) -> tuple[list[str], NDArray[np.int64]]:
    array = np.asarray(values)
    if array.ndim != 1:
        raise InputError(f"`{name}` has {array.ndim} dimensions, not 1")
    if array.dtype.kind == "O":
        array = array.astype(str)
    different, at = np.unique(array, return_inverse=True)
    return [str(it) for it in different], np.ascontiguousarray(at, dtype=np.int64)


class Recording:
    """Recorded road users: an array per column, a row per road user and instant.

    The rows may have any order. Lanes are fitted, and situations are found, when you
    create it.

    Args:
        ids: identity of the road user, numbers or texts.
        times_s: seconds since any instant.
        x_m, y_m: box centre in metres, the second axis to the left of the first.
        heading_rad: counter-clockwise from the first axis, by default that of the motion.
        speed_mps: along the heading, by default derived from the positions.
        length_m, width_m: box, by default that of the class. Give both or none.
        classes: `"pedestrian"`, `"bicycle"`, `"motorcycle"`, `"car"`, `"van"`, `"truck"`,
            `"trailer"` or `"other"`, by default cars.
        name: its name in errors and worlds.

    Raises:
        InputError: two arrays have different lengths, a value is not finite, a size is
            not positive, a class is unknown, or a road user has two rows at an instant.
    """

    def __init__(
        self,
        ids: ArrayLike,
        times_s: ArrayLike,
        x_m: ArrayLike,
        y_m: ArrayLike,
        *,
        heading_rad: ArrayLike | None = None,
        speed_mps: ArrayLike | None = None,
        length_m: ArrayLike | None = None,
        width_m: ArrayLike | None = None,
        classes: ArrayLike | None = None,
        name: str = "arrays",
    ) -> None:
        if (length_m is None) != (width_m is None):
            raise InputError("one of `length_m` and `width_m` is missing")
        size = None
        if length_m is not None and width_m is not None:
            size = (_numbers("length_m", length_m), _numbers("width_m", width_m))
        more = {
            "heading_rad": None if heading_rad is None else _numbers("heading_rad", heading_rad),
            "speed_mps": None if speed_mps is None else _numbers("speed_mps", speed_mps),
            "size_m": size,
            "classes": None if classes is None else _texts("classes", classes),
        }
        places = (_numbers("x_m", x_m), _numbers("y_m", y_m))
        self.name = name
        self._raw = RawRecording(name, _texts("ids", ids), _numbers("times_s", times_s), places, more)

    def summary(self) -> dict[str, Any]:
        """Returns road users, lanes, followings, cut-ins and crossings, as `log --json`."""
        return self._raw.summary()

    def rules(self, rules: str | os.PathLike[str] = "motorway") -> list[dict[str, Any]]:
        """Returns episodes, rates and worst instant of each rule, as `stl --log --json`.

        Args:
            rules: your rule file (`.ron`), `"motorway"` for the shipped file, or a formula.

        Raises:
            InputError: the file cannot be read, or a rule does not fit recordings.
        """
        text = os.fspath(rules)
        if text == "motorway":
            return self._raw.rules(text, True)
        if not text.endswith(".ron"):
            return self._raw.rules(text, False)
        try:
            file = Path(text).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"cannot read `{text}`: {error}") from None
        return self._raw.rules(file, True)

    def worlds(
        self,
        directory: str | os.PathLike[str],
        name: str,
        kind: str,
        *,
        count: int = 24,
        others: int = 0,
    ) -> list[World]:
        """Writes recorded situations as worlds, as `new --from-log` does.

        Args:
            directory: directory of the files.
            name: name of the first world. Further worlds are `name_2` and so on.
            kind: `"following"`, `"cut-in"` or `"crossing"`.
            count: number of situations, the hardest first.
            others: nearest other road users as scripted traffic.

        Raises:
            InputError: the recording has no such situation, or a file exists already.
        """
        worlds = self._raw.worlds((name, kind), count, others)
        if not worlds:
            raise InputError(f"no {kind} in `{self.name}`")
        folder = Path(directory)
        files = [folder / f"{world['name']}.ron" for world in worlds]
        for file in files:
            if file.exists():
                raise InputError(f"`{file}` is there already")
        for file, world in zip(files, worlds, strict=True):
            # A text that brakecheck would refuse must not reach the disk.
            RawWorld.parse(os.fspath(file), world["text"])
        folder.mkdir(parents=True, exist_ok=True)
        for file, world in zip(files, worlds, strict=True):
            file.write_text(world["text"], encoding="utf-8")
        return [World(file) for file in files]

    def picture(self) -> str:
        """Returns the recording from above, as SVG."""
        return self._raw.picture()


def fit_traffic(recordings: Sequence[Recording], file: str | os.PathLike[str]) -> dict[str, Any]:
    """Fits a model of natural driving and writes it for `natural` and `traffic`.

    You get the model with its calibration.

    Raises:
        InputError: the recordings have too little driving.
    """
    path = Path(file)
    text, model = fit_raw(path.stem, [it._raw for it in recordings])
    path.write_text(text, encoding="utf-8")
    return model
