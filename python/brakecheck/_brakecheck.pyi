"""Extension of the package. Use `brakecheck` instead."""

import os
from collections.abc import Callable
from typing import Any, SupportsIndex, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Command",
    "Mailbox",
    "Own",
    "Percept",
    "RawBench",
    "RawEpisode",
    "RawFormula",
    "RawMonitor",
    "RawPolicy",
    "RawRecording",
    "RawReplayed",
    "RawRun",
    "RawVector",
    "RawWorld",
    "Seen",
    "SeenLight",
    "command_of",
    "eval_run",
    "eval_world",
    "exit_threads",
    "export_kept",
    "fit_traffic",
    "replay_kept",
    "report_run",
    "run_program",
    "search_world",
    "train_ado",
]

_Path = str | os.PathLike[str]
_Texts = tuple[list[str], NDArray[np.int64]]
_Column = tuple[str, bool, NDArray[np.float64]]
_Buffers = tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]

def run_program(arguments: list[str]) -> int: ...
def train_ado(world: RawWorld, options: dict[str, Any], running: dict[str, Any]) -> dict[str, Any]: ...
def eval_run(options: dict[str, Any], running: dict[str, Any]) -> list[dict[str, Any]]: ...
def eval_world(
    world: RawWorld, options: dict[str, Any], running: dict[str, Any]
) -> list[dict[str, Any]]: ...
def search_world(
    world: RawWorld, options: dict[str, Any], running: dict[str, Any]
) -> list[dict[str, Any]]: ...
def report_run(
    run: _Path, output: _Path | None, starts: tuple[int, int], running: dict[str, Any]
) -> tuple[_Path, _Path]: ...
def replay_kept(options: dict[str, Any], running: dict[str, Any]) -> list[RawReplayed]: ...
def export_kept(path: _Path, directory: _Path) -> list[_Path]: ...

def exit_threads() -> None: ...
def command_of(answer: Any) -> Command: ...

@final
class Mailbox:
    def exchange(
        self, returned: object, raised: BaseException | None
    ) -> tuple[Callable[..., object], tuple[object, ...]] | None: ...

@final
class RawWorld:
    @staticmethod
    def load(file: _Path, allow_programs: bool) -> RawWorld: ...
    @staticmethod
    def parse(name: str, text: str) -> RawWorld: ...
    @staticmethod
    def text_of(value: str) -> str: ...
    def value(self) -> str: ...
    @staticmethod
    def shipped() -> list[str]: ...
    def with_parts(self, plant: str | None, ego: Any) -> RawWorld: ...
    def in_traffic(self, traffic: str | None, natural: float | None) -> RawWorld: ...
    @property
    def text(self) -> str: ...
    def about(self) -> dict[str, Any]: ...

@final
class RawBench:
    def __new__(cls, world: RawWorld, every_sample: bool) -> RawBench: ...
    def reset(self, key: tuple[str, int, int], aftermath: bool) -> NDArray[np.float32]: ...
    def reset_at(self, start: list[float], noise: int, aftermath: bool) -> NDArray[np.float32]: ...
    def step(self, action: SupportsIndex) -> tuple[NDArray[np.float32], float, bool, bool]: ...
    def info(self) -> dict[str, Any]: ...
    def render(self) -> NDArray[np.uint8]: ...
    def render_samples(self) -> list[NDArray[np.uint8]]: ...
    def trace(self) -> dict[str, NDArray[np.float64]]: ...
    def played(self) -> tuple[list[float], int, list[int]]: ...

@final
class RawVector:
    def __new__(cls, world: RawWorld, count: int, jobs: int) -> RawVector: ...
    def reset(self, purpose: str, seeds: list[int] | None, obs: NDArray[np.float32]) -> None: ...
    def step(self, actions: NDArray[np.int64], buffers: _Buffers) -> list[int]: ...
    def ended(self, over: list[int]) -> list[tuple[str, bool, float, int]]: ...
    def episodes(self, over: list[int]) -> list[dict[str, Any] | RawEpisode]: ...
    def info(self, at: int) -> dict[str, Any]: ...
    def render(self, at: int) -> NDArray[np.uint8]: ...
    def trace(self, at: int) -> dict[str, NDArray[np.float64]]: ...

@final
class RawEpisode:
    def info(self) -> dict[str, Any]: ...

@final
class RawFormula:
    def __new__(
        cls,
        text: str,
        constants: list[tuple[str, float]],
        formulas: list[tuple[str, str]],
        until: str,
        end: str,
        rho_max: float | None,
    ) -> RawFormula: ...
    def robustness(self, columns: list[_Column], dt_s: float) -> float: ...
    def satisfied(self, columns: list[_Column], dt_s: float) -> bool: ...
    def robustness_all(self, columns: list[_Column], dt_s: float) -> NDArray[np.float64]: ...
    def explain(self, columns: list[_Column], dt_s: float) -> tuple[dict[str, Any], float, str]: ...
    def monitor(
        self, signals: list[tuple[str, bool]], dt_s: float, samples: int | None
    ) -> RawMonitor: ...

@final
class RawMonitor:
    def push(self, row: list[float]) -> tuple[float, float]: ...
    def push_many(self, rows: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def finish(self) -> float: ...
    def reset(self) -> None: ...
    def __len__(self) -> int: ...

@final
class RawPolicy:
    def act(self, obs: NDArray[np.float32]) -> int: ...
    def sample(self, obs: NDArray[np.float32], temperature: float, unit: float) -> int: ...
    def value(self, obs: NDArray[np.float32]) -> float: ...

def fit_traffic(name: str, recordings: list[RawRecording]) -> tuple[str, dict[str, Any]]: ...

@final
class RawRecording:
    def __new__(
        cls,
        name: str,
        ids: _Texts,
        times_s: NDArray[np.float64],
        places_m: tuple[NDArray[np.float64], NDArray[np.float64]],
        more: dict[str, Any],
    ) -> RawRecording: ...
    def summary(self) -> dict[str, Any]: ...
    def rules(self, text: str, is_file: bool) -> list[dict[str, Any]]: ...
    def worlds(self, named: tuple[str, str], count: int, others: int) -> list[dict[str, Any]]: ...
    def picture(self) -> str: ...

@final
class RawRun:
    def __new__(cls, path: _Path) -> RawRun: ...
    def manifest(self) -> dict[str, Any]: ...
    def rows(self) -> list[dict[str, Any]]: ...
    def progress(self) -> list[dict[str, Any]]: ...
    def world(self, allow_programs: bool) -> RawWorld: ...
    def policy(self) -> RawPolicy: ...

@final
class RawReplayed:
    def about(self) -> dict[str, Any]: ...
    def trace(self) -> dict[str, NDArray[np.float64]]: ...
    def view(self, output: _Path, beside: str | None) -> None: ...
    def picture(self, format: str) -> bytes: ...

@final
class Own:
    """Speed, acceleration and place of the ego itself, as it knows them."""

    @property
    def speed_mps(self) -> float:
        """Speed along its heading, m/s."""
    @property
    def accel_mps2(self) -> float:
        """Acceleration along its heading over the last sample, m/s²."""
    @property
    def s_m(self) -> float:
        """Distance along the road of the front bumper, m."""
    @property
    def lateral_m(self) -> float:
        """Offset to the left of the middle of lane 0, m."""
    @property
    def lane(self) -> int:
        """Lane, counted from the right, 0 first."""
    @property
    def heading_rad(self) -> float:
        """Heading relative to the road's, counter-clockwise, rad."""
    @property
    def length_m(self) -> float:
        """Length of the own body, m."""
    @property
    def width_m(self) -> float:
        """Width of the own body, m."""

@final
class Seen:
    """Another road user, as the ego's sensors see it."""

    @property
    def name(self) -> str:
        """Name in the world file."""
    @property
    def headway_m(self) -> float:
        """Distance along the road from front bumper to front bumper, positive ahead, m."""
    @property
    def lateral_m(self) -> float:
        """Lateral offset relative to the ego, positive to the left, m."""
    @property
    def speed_mps(self) -> float:
        """Its speed along the road, m/s."""
    @property
    def lateral_mps(self) -> float:
        """Its speed across the road, positive to the left, m/s."""
    @property
    def lane(self) -> int:
        """Lane of its front bumper. 0 is the rightmost lane."""
    @property
    def x_m(self) -> float:
        """Position of the middle of its front, ahead in the ego's frame, m."""
    @property
    def y_m(self) -> float:
        """The same, to the left, m."""
    @property
    def heading_rad(self) -> float:
        """Its heading relative to the ego's, counter-clockwise, rad."""
    @property
    def vx_mps(self) -> float:
        """Its velocity over ground, along the ego's x, m/s."""
    @property
    def vy_mps(self) -> float:
        """The same, along the ego's y, m/s."""
    @property
    def ax_mps2(self) -> float:
        """Its acceleration along its own heading, along the ego's x, m/s²."""
    @property
    def ay_mps2(self) -> float:
        """The same, along the ego's y, m/s²."""
    @property
    def length_m(self) -> float:
        """Its length, m."""
    @property
    def width_m(self) -> float:
        """Its width, m."""

@final
class SeenLight:
    """A traffic light, as the ego sees it."""

    @property
    def name(self) -> str:
        """Name in the world file."""
    @property
    def line_m(self) -> float:
        """Distance from the front bumper to its stop line, positive before it, m."""
    @property
    def phase(self) -> str:
        """Its phase: "green", "yellow" or "red"."""
    @property
    def phase_s(self) -> float:
        """Time in this phase, s."""

@final
class Percept:
    """Perception of the ego at a sample."""

    @staticmethod
    def from_json(step: str) -> Percept:
        """Returns the percept of a `step` message of the ego protocol."""
    @property
    def time_s(self) -> float:
        """Time since the start of the episode, s."""
    @property
    def sample_s(self) -> float:
        """Time to the next percept, s."""
    @property
    def own(self) -> Own:
        """The ego itself."""
    @property
    def others(self) -> list[Seen]:
        """All other road users, in the order of the world file."""
    @property
    def lights(self) -> list[SeenLight]:
        """All traffic lights, in the order of the world file."""
    def leader(self) -> Seen | None:
        """Returns the nearest road user ahead whose body overlaps the ego's path."""
    def follower(self) -> Seen | None:
        """Returns the nearest road user behind whose body overlaps the ego's path."""
    def light(self, past_m: float = 0.0) -> SeenLight | None:
        """Returns the nearest light whose stop line is less than `past_m` behind."""

@final
class Command:
    """Request of the ego to its vehicle until the next sample."""

    def __new__(cls, accel_mps2: float, lateral_mps: float = 0.0) -> Command: ...
    @property
    def accel_mps2(self) -> float:
        """Net acceleration along the heading, m/s²."""
    @property
    def lateral_mps(self) -> float:
        """Speed across the road, positive to the left, m/s. 0 keeps the lane."""
