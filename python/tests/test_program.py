"""The wheel is the command line as well."""

import json
import subprocess
import sys
from importlib.metadata import version

import brakecheck
import pytest


def program(*arguments, module=False):
    start = [sys.executable, "-m", "brakecheck"] if module else ["brakecheck"]
    script = [sys.executable, "-c", "from brakecheck._cli import main; main()"]
    start = start if module else script
    return subprocess.run([*start, *arguments], capture_output=True, text=True)


def test_the_version_is_the_package_s():
    done = program("--version")
    assert (done.returncode, done.stdout) == (0, f"brakecheck {version('brakecheck')}\n")
    assert brakecheck.__version__ == version("brakecheck")


def test_every_verb_is_there_and_shows_itself_as_the_program():
    done = program("--help", module=True)
    assert done.returncode == 0 and "Usage: brakecheck <COMMAND>" in done.stdout
    for verb in ["train", "eval", "search", "identify", "replay", "stl", "report", "view"]:
        assert f"  {verb} " in done.stdout


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (["eval", "nowhere"], 2, "nowhere"),
        (["fly"], 2, "unrecognized subcommand"),
        (["check", "acc.rn"], 2, "acc.rn"),
    ],
)
def test_mistakes_end_with_the_documented_code(arguments, code, says):
    done = program(*arguments)
    assert done.returncode == code and says in done.stderr


def test_recordings_are_in_the_program(kept, tmp_path):
    file = tmp_path / "crash.rrd"
    done = program("view", str(kept), "acc-nominal-0001", "-o", str(file), "--json")
    assert done.returncode == 0, done.stderr
    assert file.stat().st_size == json.loads(done.stdout)["bytes"]
