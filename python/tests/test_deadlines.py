"""Egos and ados that do not answer: deadlines, Ctrl-C, and the end of the process."""

import signal
import subprocess
import sys
import threading
import time

import brakecheck
import pytest
from brakecheck import Env, FaultError, InputError, VectorEnv, _threads
from conftest import ROOT

#: Longer than any test may take: nothing but a deadline or Ctrl-C ends this.
FOR_EVER = 1000.0

#: Two seconds are promised, and at most one is taken: half of it for work to end tidily.
#: A machine whose cores are all taken, as under continuous integration, gets twice as much.
PROMPT = 4.0


def endless():
    while True:
        pass


def asleep():
    time.sleep(FOR_EVER)


def locked():
    threading.Lock().acquire() and threading.Event().wait()


HANGING = [endless, asleep, locked]


@pytest.mark.parametrize("hang", HANGING)
def test_an_ego_that_exceeds_its_deadline_is_a_fault(hang):
    def ego(percept):
        hang()

    ego.timeout_s = 0.1
    env = Env("acc", ego=ego)
    for seed in range(2):
        env.reset(seed=seed)
        _, reward, terminated, truncated, info = env.step(0)
        assert (reward, terminated, truncated) == (0.0, False, True)
        fault = info["fault"]
        assert fault["kind"] == "timeout"
        assert fault["message"].endswith("gave no answer within 0.1 s when asked for a command at 0.000 s")
        assert f"in {hang.__name__}" in fault["stderr"]
        assert "_threads.py" not in fault["stderr"]


@pytest.mark.parametrize("hang", [endless, asleep])
def test_a_fault_is_in_no_rate_and_the_others_are_played(hang):
    class Moody:
        """Fails on some starts, from the middle of the episode."""

        timeout_s = 0.1

        def control(self, percept):
            if percept.time_s == 0.0:
                self.bad = percept.own.speed_mps > 24
            if self.bad and percept.time_s > 0.2:
                self.fail()
            return 0.0

    class Hanging(Moody):
        def fail(self):
            hang()

    class Raising(Moody):
        def fail(self):
            raise RuntimeError

    asked = {"ado": lambda obs: 0, "starts": 20, "allow_invalid": 0.6}
    late, raised = (brakecheck.eval("acc", ego=ego, **asked)[0] for ego in (Hanging, Raising))
    assert 0 < late["invalid"] < 12
    assert [fault["kind"] for fault in late["faults"]] == ["timeout"]
    assert [fault["kind"] for fault in raised["faults"]] == ["error"]
    for key in ["solved", "starts", "invalid", "successes", "success_rate"]:
        assert late[key] == raised[key], key


def test_three_in_a_row_end_the_call_and_say_where():
    class Thinker:
        timeout_s = 0.1

        def control(self, percept):
            asleep()

    with pytest.raises(FaultError) as raised:
        brakecheck.eval("acc", ado=lambda obs: 0, ego=Thinker, starts=30)
    text = " ".join(str(raised.value).split())
    assert "timeout" in text and "Thinker` gave no answer within 0.1 s" in text
    assert "in asleep" in text


def test_an_ego_that_was_late_is_made_anew():
    class Once:
        timeout_s = 0.1
        made = []

        def __init__(self):
            self.made.append(self)
            self.briefed = False

        def brief(self, briefing):
            self.briefed = True

        def control(self, percept):
            assert self.briefed
            if len(self.made) == 1:
                asleep()
            return 0.0

    env = Env("acc", ego=Once)
    env.reset(seed=0)
    assert env.step(0)[4]["fault"]["kind"] == "timeout" and len(Once.made) == 1
    env.reset(seed=0)
    assert env.step(0)[4].get("fault") is None and len(Once.made) == 2


@pytest.mark.parametrize(
    ("method", "asked"),
    [("__init__", "when made"), ("brief", "when briefed"), ("reset", "when asked to reset")],
)
def test_every_method_has_the_deadline(method, asked):
    def hang(self, *_):
        asleep()

    members = {"timeout_s": 0.1, "control": lambda self, percept: 0.0, method: hang}
    env = Env("acc", ego=type("Slow", (), members))
    env.reset(seed=0)
    fault = env.step(0)[4]["fault"]
    assert fault["kind"] == "timeout" and fault["message"].endswith(f"within 0.1 s {asked}")


def test_a_fork_has_the_deadline():
    class Forking:
        timeout_s = 0.1

        def control(self, percept):
            return 0.0

        def fork(self):
            asleep()

    with pytest.raises(FaultError, match="(?s)timeout.*when asked to fork"):
        brakecheck.search("acc", ego=Forking, switches=1, starts=1)


@pytest.mark.parametrize("timeout_s", [0.0, -1.0, 1e6, float("nan")])
def test_deadlines_are_those_that_programs_may_have(timeout_s):
    def ego(percept):
        return 0.0

    ego.timeout_s = timeout_s
    with pytest.raises(InputError, match="0.001 to 86400 s are possible; 10 s are usual"):
        Env("acc", ego=ego)


def test_a_deadline_is_a_number():
    def ego(percept):
        return 0.0

    ego.timeout_s = True
    with pytest.raises(InputError, match="True is no number"):
        Env("acc", ego=ego)


def pressed(play):
    """Seconds from Ctrl-C to the end of `play`, which sets the event it is given.

    Ctrl-C comes as soon as the event is set.
    """
    hanging, at = threading.Event(), []

    def press():
        hanging.wait()
        at.append(time.monotonic())
        signal.raise_signal(signal.SIGINT)

    threading.Thread(target=press, daemon=True).start()
    with pytest.raises(KeyboardInterrupt):
        play(hanging)
    return time.monotonic() - at[0]


def waits(hang):
    """An ego that hangs, or an ado, for ever but for Ctrl-C."""

    def ego(hanging):
        def control(percept):
            hanging.set()
            hang()

        control.timeout_s = FOR_EVER
        return control

    return ego


def stepped(env):
    env.reset(seed=0)
    env.step([0] * env.num_envs if isinstance(env, VectorEnv) else 0)


PLAYS = {
    "eval": lambda ego: brakecheck.eval("acc", ado=lambda obs: 0, ego=ego, starts=5),
    "eval on two threads": lambda ego: brakecheck.eval("acc", ego=ego, starts=5, jobs=2),
    "eval of an ado": lambda ado: brakecheck.eval("acc", ado=ado, starts=5),
    "search": lambda ego: brakecheck.search("acc", ego=ego, starts=5),
    "replay": lambda ego: brakecheck.replay(ROOT / "tests" / "regressions" / "acc-nominal-0001.ron", ego=ego),
    "Env": lambda ego: stepped(Env("acc", ego=ego)),
    "VectorEnv": lambda ego: stepped(VectorEnv("acc", 3, ego=ego)),
    "VectorEnv on two threads": lambda ego: stepped(VectorEnv("acc", 3, ego=ego, jobs=2)),
}


@pytest.mark.parametrize("hang", [endless, asleep])
@pytest.mark.parametrize("play", PLAYS)
def test_ctrl_c_ends_every_call_in_which_python_hangs(play, hang):
    assert pressed(lambda hanging: PLAYS[play](waits(hang)(hanging))) < PROMPT


def test_ctrl_c_ends_a_training_in_which_python_hangs(tmp_path):
    def train(hanging):
        brakecheck.train("acc", tmp_path / "run", ego=waits(endless)(hanging))

    assert pressed(train) < PROMPT


PROGRAM = """
import sys, time
open(sys.argv[1], "w").close()
time.sleep(1000)
"""


@pytest.mark.parametrize(
    "play", ["eval", "Env", "VectorEnv", "VectorEnv on two threads"]
)
def test_ctrl_c_ends_every_call_in_which_a_program_hangs(play, tmp_path):
    started = tmp_path / "started"

    def call(hanging):
        def look():
            while not started.exists():
                time.sleep(0.01)
            hanging.set()

        threading.Thread(target=look, daemon=True).start()
        PLAYS[play]([sys.executable, "-c", PROGRAM, str(started)])

    assert pressed(call) < PROMPT


def test_ctrl_c_ends_a_search_that_nobody_could_wait_for():
    def call(hanging):
        hanging.set()
        brakecheck.search("acc", switches=3, starts=1)

    assert pressed(call) < PROMPT


def test_a_thread_that_is_abandoned_between_two_calls_ends_quietly(monkeypatch):
    reported, abandoned = [], threading.Event()
    monkeypatch.setattr(threading, "excepthook", reported.append)

    class Mailbox:
        """Has no call yet."""

        def exchange(self, returned, raised):
            abandoned.wait()

    thread = _threads.start(Mailbox())
    _threads.abandon(thread)
    abandoned.set()
    thread.join()
    assert reported == []


def test_what_was_interrupted_can_be_played_again():
    hanging = threading.Event()
    calm = threading.Event()

    def ego(percept):
        if not calm.is_set():
            hanging.set()
            endless()
        return 0.0

    env = Env("acc", ego=ego)
    pressed(lambda event: (threading.Thread(target=lambda: hanging.wait() and event.set()).start(), stepped(env)))
    calm.set()
    env.reset(seed=0)
    assert env.step(0)[4].get("fault") is None


AFTERWARDS = """
import threading, time, brakecheck

def swallows():
    while True:
        try:
            while True:
                pass
        except BaseException:
            pass

def sleeps():
    time.sleep(1000)

def ego(percept):
    HANG()

ego.timeout_s = 0.1
env = brakecheck.Env("acc", ego=ego)
env.reset(seed=0)
print(env.step(0)[4]["fault"]["kind"])
try:
    brakecheck.eval("acc", ego=ego, starts=5)
except brakecheck.FaultError:
    print("fault")
raise SystemExit(7)
"""


@pytest.mark.parametrize("hang", ["swallows", "sleeps"])
def test_a_process_ends_whatever_an_ego_still_does(hang):
    script = AFTERWARDS.replace("HANG", hang)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (7, "timeout\nfault\n", "")
