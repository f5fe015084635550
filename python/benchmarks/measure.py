"""Runs every measurement in this interpreter and writes them as JSON: measure.py FILE"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import environments
import formulas
import learning
from timing import version_of

PACKAGES = ["brakecheck", "highway-env", "stable-baselines3", "torch", "rtamt", "mstlo-python"]


def main() -> None:
    found = {"versions": {name: version_of(name) for name in PACKAGES}}
    parts = {
        "formulas": formulas.costs,
        "environments": environments.ours,
        "highways": environments.highways,
        "trainings": learning.trainings,
    }
    for name, part in parts.items():
        print(f"measuring {name}", file=sys.stderr, flush=True)
        found[name] = part()
    Path(sys.argv[1]).write_text(json.dumps(found, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
