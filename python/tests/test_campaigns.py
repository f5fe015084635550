"""Train, evaluate, keep, replay: the rows and bits of the command line."""

import base64
import json
import signal
import subprocess
import sys
import threading
import time

import brakecheck
import numpy as np
import onnx
import pytest
from onnx.reference import ReferenceEvaluator
from brakecheck import Ado, Env, FaultError, InputError, Replayed, Run


def program(*arguments):
    start = [sys.executable, "-m", "brakecheck"]
    done = subprocess.run([*start, *arguments, "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def without_cost(rows):
    return [{key: row[key] for key in row if key != "cpu_s"} for row in rows]


def test_training_gives_the_files_of_the_command_line(run, tmp_path):
    from conftest import ROOT

    world = str(ROOT / "worlds" / "acc.ron")
    told = program(
        "train", world, "-o", str(tmp_path / "acc"), "--decisions", "3000", "--seed", "1",
        "--starts", "20",
    )
    assert without_cost(told["rows"]) == without_cost(run.rows)
    mine, theirs = run.manifest, Run(tmp_path / "acc").manifest
    assert mine["policy_sha256"] == theirs["policy_sha256"]
    assert run.progress == Run(tmp_path / "acc").progress


def test_rows_are_those_of_the_command_line(run):
    asked = ["eval", run.path, "--starts", "30", "--seed", "2", "--search", "1"]
    told = program(*asked, "--ego", "firm gains", "--ado", "trained", "--ado", "hold")
    rows = brakecheck.eval(
        run, ado=["trained", "hold"], ego="firm gains", starts=30, seed=2, search=1
    )
    assert without_cost(rows) == without_cost(told["rows"])
    assert rows.run is run and rows.row("hold")["ado"] == "hold"


def test_a_trained_ado_plays_in_environments_as_in_evaluations(run):
    ado, env = Ado(run), Env("acc")
    outcomes = ""
    for index in range(20):
        obs, _ = env.reset(options={"purpose": "test", "index": index})
        over = False
        while not over:
            obs, _, terminated, truncated, info = env.step(ado(obs))
            over = terminated or truncated
        outcomes += "1" if info["is_success"] else "0"
    solved = brakecheck.eval(run, starts=20)[0]["solved"]
    assert all(mine == one for mine, one in zip(outcomes, solved) if one != "t")
    assert len(solved) == 20


def test_an_ado_of_one_s_own_has_the_rows_of_the_trained_one(run):
    ado = Ado(run)
    rows = brakecheck.eval("acc", ado=ado, starts=20, search=1)
    trained = brakecheck.eval(run, ado=["trained", "hold", "random", "constant"], starts=20, search=1)
    # Only the run of a training is warned of: an ado of one's own has none.
    named = {"ado", "adversary", "method", "train_seed", "cpu_s", "warning"}
    for mine, theirs in zip(rows, trained):
        assert {k: v for k, v in mine.items() if k not in named} == {
            k: v for k, v in theirs.items() if k not in named
        }
    assert rows[0]["ado"] == "python" and rows[0]["method"] == "Ado"


def test_a_test_of_no_starts_is_refused():
    for asked in (brakecheck.eval, brakecheck.search):
        with pytest.raises(InputError, match="0 starts"):
            asked("acc", starts=0)


def test_a_share_that_is_none_is_refused():
    for share in (-0.1, 1.5, float("nan")):
        with pytest.raises(InputError, match="is a share"):
            brakecheck.search("acc", starts=3, allow_invalid=share)


def test_options_that_a_world_would_ignore_are_refused(tmp_path):
    with pytest.raises(InputError, match="are about the ado of a run"):
        brakecheck.eval("acc", starts=3, temperature=0.1)
    with pytest.raises(InputError, match="`keep` needs an ado"):
        brakecheck.eval("acc", starts=3, keep=tmp_path / "kept")
    with pytest.raises(InputError, match="budget"):
        brakecheck.search("acc", starts=3, budget=5)
    with pytest.raises(InputError, match="0 simulations"):
        brakecheck.search("acc", starts=3, method="uniform", budget=0)


@pytest.mark.parametrize(
    ("ado", "says"),
    [(lambda obs: 99, "an action is a whole number from 0 to"), (7, "is no ado")],
)
def test_an_ado_that_is_none_is_refused(ado, says):
    with pytest.raises(InputError, match=says):
        brakecheck.eval("acc", ado=ado, starts=3)


def test_an_ado_that_raises_is_heard():
    def broken(obs):
        raise LookupError("no such layer")

    with pytest.raises(LookupError, match="no such layer"):
        brakecheck.eval("acc", ado=broken, starts=3)


def test_an_ado_decides_by_signals_as_by_observations(run):
    ado, env = Ado(run), Env("acc")
    obs, _ = env.reset(seed=0)
    signals = {name: column[-1] for name, column in env.trace().items()}
    assert np.array_equal(ado.observe(signals), obs)
    assert ado.decide(signals) == ado(obs) and ado.label(ado(obs)) in ado.actions
    assert ado.command(signals)["ado"]["lateral_mps"] == 0.0
    assert f"{ado.command(signals)['ado']['accel_mps2']:+g} m/s²" == ado.label(ado(obs))
    with pytest.raises(InputError, match="the ado also observes"):
        ado.decide({})
    with pytest.raises(InputError, match="this ado observes"):
        ado([0.0])


def test_an_exported_ado_is_weights_and_what_it_observes(run, tmp_path):
    weights, spec, _ = Ado(run).export(tmp_path / "out")
    described = json.loads(open(spec, encoding="utf-8").read())
    assert described["policy_sha256"] == run.manifest["policy_sha256"]
    assert [one["name"] for one in described["observation"]] == [
        one["name"] for one in run.world().observation
    ]
    assert open(weights, "rb").read() == open(f"{run.path}/policy.safetensors", "rb").read()


def test_the_exported_network_decides_as_the_ado(run, tmp_path):
    ado = Ado(run)
    *_, network = ado.export(tmp_path / "out")
    onnx.checker.check_model(onnx.load(network), full_check=True)
    played = ReferenceEvaluator(network)
    obs = np.random.default_rng(0).uniform(-1, 1, (500, len(ado.observation))).astype(np.float32)
    values, actions = played.run(None, {"observation": obs})
    assert actions.tolist() == [ado(one) for one in obs]
    assert len(set(actions.tolist())) > 1
    assert np.allclose(values.max(axis=1), [ado.value(one) for one in obs], atol=1e-5)


def test_kept_counterexamples_are_a_regression_test(tmp_path):
    def sleepy(percept):
        return 0.0

    def careful(percept):
        return -8.0 if percept.own.speed_mps > 0.1 else 0.0

    rows = brakecheck.search("acc", ego=sleepy, starts=6, switches=1, keep=tmp_path, keep_most=2)
    assert rows[0]["successes"] > 0
    kept = brakecheck.replay(tmp_path)
    assert len(kept) == 2 and all(one.identical and one.still_fails for one in kept)
    assert all(one.still_fails for one in brakecheck.replay(tmp_path, ego=sleepy))
    # From one of the two starts nobody could have stopped in time.
    fixed = [not one.still_fails for one in brakecheck.replay(tmp_path, ego=careful)]
    assert sorted(fixed) == [False, True]
    assert "counterexample, still fails" in repr(kept[0])


def test_a_training_against_python_says_so(tmp_path):
    def sleepy(percept):
        return 0.0

    run = brakecheck.train("acc", tmp_path / "run", ego=sleepy, decisions=500, starts=5)
    name = run.manifest["ego"]["name"]
    assert name.endswith("sleepy") and run.rows[0]["ego"] == name
    rows = brakecheck.eval(run, ego=sleepy, starts=5)
    assert rows[0]["ego"] == name
    with pytest.raises(InputError, match="already|finished|other|against|exists"):
        brakecheck.train("acc", tmp_path / "run", decisions=500)


def test_recordings_pages_and_scenarios_are_written(kept, run, tmp_path):
    recorded = brakecheck.view(kept, tmp_path / "crash.rrd", episode="acc-nominal-0001")
    assert open(recorded, "rb").read(4) == b"RRF2"
    page = brakecheck.report(run, tmp_path / "page.html", starts=5)
    assert "<html" in open(page, encoding="utf-8").read()
    files = brakecheck.export(kept / "acc-nominal-0001.ron", tmp_path / "xosc")
    assert len(files) == 3


def test_rows_are_shown_and_become_frames(run):
    rows = run.rows
    assert repr(rows).splitlines()[0].split()[:3] == ["ego", "ado", "method"]
    assert rows.to_pandas()["success_rate"].tolist() == [row["success_rate"] for row in rows]
    assert rows._repr_html_().count("<tr>") == len(rows) + 1
    row = rows.row(rows[0]["ado"])
    assert row == rows[0] and row._repr_html_().count("<tr>") == 2
    assert f"<td>{row['ego']}</td>" in row._repr_html_()


def test_kept_crashes_show_themselves_in_notebooks(kept):
    crashes = brakecheck.replay(kept, episode="acc-nominal-0001")
    page = crashes[0]._repr_html_()
    assert crashes[0].about["words"].startswith("failed: ρ ")
    assert crashes[0].about["words"] in page and "still fails" in page
    svg = base64.b64decode(page.split("base64,")[1].split('"')[0]).decode()
    assert svg.startswith("<svg") and "@keyframes" in svg
    png, shown = crashes[0]._repr_png_()
    assert png.startswith(b"\x89PNG") and shown == {"width": 900}
    table = crashes._repr_html_()
    assert table.count("<tr>") == 2 and "acc-nominal-0001.ron" in table


def test_a_replay_that_did_not_run_shows_its_words_alone():
    class Raw:
        def about(self):
            words = {"path": "<b>.ron", "words": "did not run", "verdict": "invalid"}
            return words | {"fault": "no plan", "outcome": "", "identical": False}

    broken = Replayed(Raw())
    assert broken._repr_html_() == "<p>&lt;b&gt;.ron: did not run</p>"
    assert broken._repr_png_() is None


def test_progress_and_remarks_come_while_it_runs(tmp_path):
    heard = []
    brakecheck.train(
        "acc", tmp_path / "run", decisions=4_000, starts=50, progress=lambda *told: heard.append(told)
    )
    assert all(done <= total for _, done, total, _ in heard)
    assert {4_000, 50} <= {total for _, _, total, _ in heard}


def test_ctrl_c_stops_a_training_that_can_be_gone_on_with(tmp_path):
    threading.Timer(1.5, lambda: signal.raise_signal(signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        brakecheck.train("acc", tmp_path / "run", decisions=5_000_000)
    manifest = Run(tmp_path / "run").manifest
    assert manifest["policy_sha256"] is None
    assert manifest["checkpoint"] is not None


def test_other_threads_run_meanwhile():
    counted = []
    stop = threading.Event()

    def count():
        while not stop.is_set():
            counted.append(None)
            time.sleep(0)

    thread = threading.Thread(target=count)
    thread.start()
    brakecheck.search("acc", starts=200, switches=2)
    stop.set()
    thread.join()
    assert len(counted) > 100


def test_an_invalid_share_may_be_allowed():
    def moody(percept):
        if percept.time_s == 0 and percept.own.speed_mps > 20:
            raise RuntimeError("too fast for me")
        return 0.0

    with pytest.raises(FaultError, match="too fast for me"):
        brakecheck.eval("acc", ado=lambda obs: 0, ego=moody, starts=30)
    row = brakecheck.eval("acc", ado=lambda obs: 0, ego=moody, starts=30, allow_invalid=0.6)[0]
    assert 0 < row["invalid"] < 18 and row["faults"][0]["kind"] == "error"
