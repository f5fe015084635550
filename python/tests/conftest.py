"""What several tests share: the checkout's kept crashes, and one short training."""

from pathlib import Path

import brakecheck
import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def kept():
    """Kept counterexamples of the checkout."""
    return ROOT / "tests" / "regressions"


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    """A short training in `acc`."""
    where = tmp_path_factory.mktemp("runs") / "acc"
    return brakecheck.train("acc", where, decisions=3_000, seed=1, starts=20, progress=False)
