"""The wheel is the command line as well."""

import json
import re
import subprocess
import sys
from pathlib import Path
from importlib.metadata import metadata, version

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


def test_the_wheel_has_its_documents():
    described = metadata("brakecheck")
    text = described.get("Description") or described.get_payload()
    page = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    assert text.strip() == page.strip()
    assert described["License-Expression"] == "MIT" and "LICENSE" in described.get_all("License-File")[0]
    named = {name: getattr(brakecheck, name) for name in brakecheck.__all__}
    members = {
        f"{name}.{key}": value
        for name, it in named.items() if isinstance(it, type)
        for key, value in vars(it).items() if callable(value) and not key.startswith("_")
    }
    silent = [name for name, it in (named | members).items() if not (it.__doc__ or "").strip()]
    assert not silent and len(members) > 30


def test_every_verb_is_there_and_shows_itself_as_the_program():
    done = program("--help", module=True)
    assert done.returncode == 0 and "Usage: brakecheck " in done.stdout
    listed = done.stdout.split("\nOptions:")[0]
    assert re.findall("^  ([a-z]+) ", listed, re.MULTILINE) == [
        "new", "check", "worlds", "drive",
        "search", "eval", "train", "risk", "campaign",
        "gate", "sweep", "harden",
        "replay", "coverage", "view", "export", "report",
        "stl", "log", "serve", "lsp", "reference", "completions", "man",
    ]


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


@pytest.mark.parametrize("beside", [None, "FSM"])
def test_pictures_are_those_of_the_program(kept, tmp_path, beside):
    file = str(kept / "cut_in_clear-idm-0074.ron")
    told = program("view", file, "-o", str(tmp_path / "told.svg"), *(["--beside", beside] if beside else []))
    assert told.returncode == 0, told.stderr
    drawn = brakecheck.view(file, tmp_path / "drawn.SVG", beside=beside)
    assert open(drawn, "rb").read() == (tmp_path / "told.svg").read_bytes()
    again = brakecheck.replay(file)[0].view(tmp_path / "again.svg", beside=beside)
    assert open(again, "rb").read() == (tmp_path / "told.svg").read_bytes()


def test_stills_and_loops_are_those_of_the_program(kept, tmp_path):
    file = str(kept / "acc-nominal-0001.ron")
    for name, begins in {"crash.png": b"\x89PNG", "crash.gif": b"GIF89a"}.items():
        told = program("view", file, "-o", str(tmp_path / name))
        assert told.returncode == 0, told.stderr
        drawn = open(brakecheck.view(file, tmp_path / f"own-{name}"), "rb").read()
        assert drawn.startswith(begins) and drawn == (tmp_path / name).read_bytes()


def test_the_ego_in_a_picture_has_its_name(kept, tmp_path):
    def sleepy(percept):
        return 0.0

    file = brakecheck.view(kept / "acc-nominal-0001.ron", tmp_path / "own.svg", ego=sleepy)
    assert "sleepy" in open(file, encoding="utf-8").read()


@pytest.mark.parametrize("name", ["crash.webp", "crash"])
def test_other_files_are_refused_as_by_the_program(kept, tmp_path, name):
    file, output = str(kept / "acc-nominal-0001.ron"), str(tmp_path / name)
    told = program("view", file, "-o", output)
    assert told.returncode == 2
    with pytest.raises(brakecheck.InputError) as raised:
        brakecheck.view(file, output)
    for text in [told.stderr, str(raised.value)]:
        # Long lines are broken, at different places on a terminal.
        text = " ".join(text.replace("│", " ").split())
        assert "is neither a recording nor a picture" in text and "name a `.rrd`" in text
    assert list(tmp_path.iterdir()) == []


def test_what_a_picture_has_beside_it_is_a_driver(kept, tmp_path):
    file = kept / "acc-nominal-0001.ron"
    with pytest.raises(brakecheck.InputError, match="`beside=\"fsm\"` is not known"):
        brakecheck.view(file, tmp_path / "crash.svg", beside="fsm")
    with pytest.raises(brakecheck.InputError, match="`beside` is for pictures"):
        brakecheck.view(file, tmp_path / "crash.rrd", beside="FSM")
