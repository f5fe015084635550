"""The page target/benchmarks/benchmarks.md from the measurements."""

from __future__ import annotations

from typing import Any

INTRODUCTION = """\
# Speed beside other programs

One command measures and writes this page:

```sh
python3 python/benchmarks/compare.py
```

It builds the wheel and installs the other programs below `target/`.

Figures are processor time of one core: the fastest of several runs in which the programs take turns.
A ratio above 1 means that brakecheck is faster.
"""

STEPS = """\
## Environments

The hand loop is [a Rust program](../../benches/hand_loop.rs) for the world `acc` on the kinematic plant only.
It has the same motion, trace and verdicts, but a smaller percept, and you cannot change its scene.
Its ratio is the price of worlds in files.
"""

HIGHWAY = """\
highway-env has more vehicles and other physics.
Compare vehicle-seconds (simulated seconds of all vehicles) rather than steps:
"""

LEARNING = """\
## Learning

Both programs train a DQN on `acc` with two layers of 64 units, batches of 64 and an update every two decisions.
brakecheck adds prioritised replay, three-step returns and restarts.
Stable-Baselines3 steps the environment from Python.
The table shows speed, not success.
"""

FORMULAS = """\
## Formulas

The command first verifies that all programs return equal robustness, where `x > 0.5` has x − 0.5.
W is in samples.

Online, your Python program passes one sample per call.
brakecheck returns bounds of the whole formula.
The others return the inner formula W samples later, and your program keeps its minimum.
Offline, you get the robustness at each of 100,000 samples.
A dash marks an unsupported formula or a missing program.
"""


def text(found: dict[str, Any]) -> str:
    """Returns the whole page."""
    parts = [INTRODUCTION, versions(found), STEPS, steps(found), highway(found)]
    parts += [LEARNING, learning(found), FORMULAS, formulas(found)]
    return "\n".join(parts)


def table(headings: str, rows: list[list[str]]) -> str:
    """Returns a Markdown table of a column of text and columns of numbers."""
    columns = headings.split(" | ")
    lines = [f"| {headings} |", "| --- |" + " --: |" * (len(columns) - 1)]
    lines += [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join(lines) + "\n"


def number(value: float | None) -> str:
    """Three significant digits, thousands separated."""
    if value is None:
        return "missing"
    if value >= 1000:
        digits = len(str(int(value))) - 3
        return f"{round(value, -digits):,.0f}"
    return f"{value:.3g}"


def ratio(faster: float | None, slower: float | None) -> str:
    """The quotient to two significant digits, or a dash where a program is missing."""
    if faster is None or slower is None:
        return "–"
    quotient = faster / slower
    return number(quotient) if quotient >= 100 else f"{quotient:.2g}"


def versions(found: dict[str, Any]) -> str:
    rows = [[name, version or "missing"] for name, version in found["versions"].items()]
    return table("program | version", [["machine", found["machine"]], *rows])


def steps(found: dict[str, Any]) -> str:
    hand = found["hand"] or {}
    rows = []
    for plant, rates in found["environments"].items():
        for name, rate in rates.items():
            envs = name.partition("(")[2].rstrip(")") or "1"
            # The loop by hand has no rigid bodies.
            rows.append(beside(f"{plant}, Python `{name}`", rate, hand, envs, plant))
        for envs in ("1", "64", "4096"):
            rate = hand.get(f"{plant} {envs}")
            if rate is not None:
                rows.append(beside(f"{plant}, Rust `Gym` × {envs}", rate, hand, envs, plant))
    for envs in ("1", "64", "4096"):
        rate = hand.get(f"vector {envs}")
        if rate is not None:
            row = beside(f"kinematic, Rust `VectorEnv({envs})`", rate, hand, envs, "kinematic")
            rows.append(row)
    return table("decisions per CPU-s | brakecheck | hand loop | ratio", rows)


def beside(name: str, rate: float, hand: dict[str, float], envs: str, plant: str) -> list[str]:
    if plant == "rigid":
        return [name, number(rate), "–", "–"]
    other = hand.get(f"hand {envs}")
    return [name, number(rate), number(other), ratio(rate, other)]


def highway(found: dict[str, Any]) -> str:
    if found["highways"] is None:
        return "highway-env is missing.\n"
    rows = []
    for each in found["highways"]:
        scene = f"{each['name']}: {each['vehicles']} vehicles, {each['hertz']} Hz, 1 s a step"
        for key, unit in (("steps", "steps"), ("moved", "vehicle-seconds")):
            rates = each[key]
            sides = [number(rates["ours"]), number(rates["theirs"])]
            rows.append([f"{unit} per CPU-s, {scene}", *sides, ratio(rates["ours"], rates["theirs"])])
    headings = "`acc`: 2 vehicles, 20 Hz, 0.5 s a step | brakecheck | highway-env | ratio"
    return HIGHWAY + "\n" + table(headings, rows)


def learning(found: dict[str, Any]) -> str:
    rows = []
    for each in found["trainings"]:
        name = f"{each['plant']}, {each['decisions']:,} decisions"
        sides = [number(each["ours"]), number(each["theirs"])]
        rows.append([name, *sides, ratio(each["ours"], each["theirs"])])
    return table("decisions per CPU-s | brakecheck | Stable-Baselines3 | ratio", rows)


def formulas(found: dict[str, Any]) -> str:
    rows = []
    for each in found["formulas"]:
        name = f"{each['mode']} `{each['formula']}`, W = {each['window']:,}"
        ours = each["ns"]["ours"]
        row = [name, number(ours)]
        for rival in ("rtamt", "mstlo"):
            theirs = each["ns"].get(rival)
            row += [number(theirs) if theirs else "–", ratio(theirs, ours)]
        rows.append(row)
    headings = "ns per sample | brakecheck | rtamt | ratio | mstlo | ratio"
    return table(headings, rows)
