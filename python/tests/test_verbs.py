"""Verbs that run the program, and Python egos that are programs."""

import json
import subprocess
import sys

import brakecheck
import pytest
from brakecheck import FaultError, InputError

MINE = """
import brakecheck

class Mine:
    def brief(self, briefing):
        self.sample_s = briefing["sample_s"]
    def reset(self, seed):
        print("a remark that is no answer")
    def control(self, percept):
        leader = percept.leader()
        near = leader is not None and leader.headway_m < 2 * percept.own.speed_mps
        return -4.0 if near else 0.5

if __name__ == "__main__":
    brakecheck.serve_ego(Mine)
"""


@pytest.fixture(scope="module")
def mine(tmp_path_factory):
    """The words of a program whose ego is a Python class."""
    file = tmp_path_factory.mktemp("ego") / "mine.py"
    file.write_text(MINE)
    return [sys.executable, str(file)]


def test_a_gate_is_that_of_the_command_line(run):
    gates = brakecheck.gate(run, "nominal", ego="firm gains", starts=20, on="any")
    asked = [
        "gate", run.path, "--baseline-ego", "nominal", "--ego", "firm gains", "--starts", "20",
        "--on", "any", "--json",
    ]
    done = subprocess.run(
        [sys.executable, "-m", "brakecheck", *asked], capture_output=True, text=True
    )
    told = json.loads(done.stdout)["gates"]
    assert list(gates) == told and len(told) == 1
    assert gates.passed == (done.returncode == 0) == (told[0]["closed_by"] == [])
    frame = gates.to_pandas()
    assert list(frame["ego"]) == ["firm gains"]
    assert frame["newly_failing_by.unknown"][0] == told[0]["newly_failing_by"]["unknown"]


def test_a_python_ego_is_a_program_with_the_same_rows(run, mine, tmp_path):
    namespace = {"__name__": "mine"}
    exec(MINE, namespace)
    inside = brakecheck.eval(run, ego=namespace["Mine"], ado="trained", starts=10)[0]
    # The lag belongs to the car of the world, and a program in a file states its own.
    file = tmp_path / "mine.ron"
    command = json.dumps(mine)
    file.write_text(f"Change(controller: Process(command: {command}, lag_s: 0.4))")
    asked = {"ado": "trained", "starts": 10, "allow_programs": True}
    outside = brakecheck.verb("eval", run, ego=str(file), **asked)[0]
    keys = ("successes", "starts", "solved", "physics_steps")
    assert [inside[key] for key in keys] == [outside[key] for key in keys]
    assert brakecheck.gate(run, "nominal", ego=mine, starts=10, on="never").passed


def test_an_exception_of_a_served_ego_is_a_fault_with_its_traceback(run, tmp_path):
    file = tmp_path / "broken.py"
    file.write_text(
        "import brakecheck\n"
        "def broken(percept):\n"
        "    return 1 / 0\n"
        "brakecheck.serve_ego(broken)\n"
    )
    with pytest.raises(FaultError, match="ZeroDivisionError"):
        brakecheck.verb("eval", run, ego=[sys.executable, str(file)], ado="trained", starts=5)


def test_wrong_requests_are_those_of_the_program(run):
    with pytest.raises(InputError, match="--start"):
        brakecheck.gate(run, "nominal", start=5)
    with pytest.raises(InputError, match="nobody"):
        brakecheck.gate(run, "nobody", starts=5)
    with pytest.raises(InputError, match="serve_ego"):
        brakecheck.gate(run, "nominal", ego=lambda percept: 0.0)
    with pytest.raises(InputError, match="plant"):
        brakecheck.risk(brakecheck.World("acc", plant="kinematic"))


def test_a_sweep_and_a_risk_are_tables(run):
    swept = brakecheck.sweep(run, "ego.time_gap_s=0.8..2.0:3", starts=10)
    assert [point["value"] for point in swept.about["swept"]["points"]] == [0.8, 1.4, 2.0]
    assert set(swept.to_pandas()["ado"]) == {"trained"}
    asked = {"traffic": "motorway", "plant": "kinematic"}
    risks = brakecheck.risk("acc", natural_runs=5000, budget=6000, **asked)
    assert list(risks.to_pandas()["ego"]) == ["nominal"] and risks.about["world"] == "acc"
    with pytest.raises(FaultError) as refused:
        brakecheck.risk("acc", natural_runs=1000, budget=1000, **asked)
    assert refused.value.outcome[0]["checks"]["refusals"]


def test_a_coverage_is_an_object_per_world(run):
    covered = brakecheck.coverage(run, starts=20)
    assert [world["world"] for world in covered] == ["acc"]
    assert covered[0]["tries"] > 0 and covered[0]["rules"] and covered[0]["parts"]


def test_a_campaign_is_planned_played_in_pieces_and_merged(tmp_path):
    file = tmp_path / "two.ron"
    file.write_text(
        'Campaign(name: "two", worlds: [(file: "acc", plant: Kinematic)],\n'
        "    ados: [Neutral, Held], starts: Drawn(count: 20))\n"
    )
    planned = brakecheck.plan(file, tmp_path / "plan", piece_s=0.05)
    pieces = planned.about["pieces"]
    done = [brakecheck.run_piece(tmp_path / "plan", piece).about["done"] for piece in range(pieces)]
    assert len(done) == pieces > 1
    merged = brakecheck.merge(tmp_path / "plan")
    assert {row["ado"] for row in merged} == {"neutral", "hold"}


def test_replays_are_a_table(kept):
    replays = brakecheck.replay(kept, episode=0)
    assert list(replays.to_pandas()["outcome"]) == [replays[0].about["outcome"]]


def test_a_served_ego_declares_its_parameters_and_receives_their_values(tmp_path):
    file = tmp_path / "tunable.py"
    file.write_text(
        "import brakecheck\n"
        "class Mine:\n"
        "    def brief(self, briefing):\n"
        "        assert briefing['parameters'] == {'brake': 2.5}\n"
        "    def control(self, percept):\n"
        "        return 0.0\n"
        "brakecheck.serve_ego(Mine, parameters={'brake': (0.0, 6.0, 1.0)})\n"
    )
    asked = [
        {"hello": {"protocol": 1}},
        {"id": 1, "reset": {"seed": 1, "parameters": {"brake": 2.5}}},
        {"close": {}},
    ]
    done = subprocess.run(
        [sys.executable, str(file)],
        input="".join(json.dumps(line) + "\n" for line in asked),
        capture_output=True,
        text=True,
    )
    hello, ready = map(json.loads, done.stdout.splitlines())
    declared = {"name": "brake", "lo": 0.0, "hi": 6.0, "default": 1.0}
    assert hello["hello"]["parameters"] == [declared]
    assert ready == {"id": 1, "ready": True}
