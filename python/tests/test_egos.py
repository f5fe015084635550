"""Python as the system under test."""

import brakecheck
import numpy as np
import pytest
from brakecheck import Env, FaultError, InputError


def two_seconds(percept):
    """Brakes whenever the car ahead is nearer than two seconds."""
    leader = percept.leader()
    if leader is None:
        return 0.5
    near = leader.headway_m < 2 * percept.own.speed_mps
    return -4.0 if near else 0.5


class TwoSeconds:
    """The same as a class."""

    def reset(self, seed):
        self.asked = 0

    def control(self, percept):
        self.asked += 1
        return brakecheck.Command(two_seconds(percept))

    def fork(self):
        other = TwoSeconds()
        other.asked = self.asked
        return other


class Configured(TwoSeconds):
    """Only to be made with an argument: passed as an object."""

    def __init__(self, harder):
        self.harder = harder

    def control(self, percept):
        return two_seconds(percept) * self.harder

    fork = None


def without_cost(rows):
    return [{key: row[key] for key in row if key not in ("cpu_s", "ego")} for row in rows]


def test_a_function_a_class_and_an_object_drive_alike():
    egos = [two_seconds, TwoSeconds, TwoSeconds(), Configured(1.0)]
    rows = [brakecheck.eval("acc", ego=ego, starts=10, search=0) for ego in egos]
    assert [row[0]["ego"] for row in rows] == ["two_seconds", "TwoSeconds"] * 1 + ["TwoSeconds", "Configured"]
    first = without_cost(rows[0])
    assert all(without_cost(other) == first for other in rows[1:3])
    assert sum(row["successes"] for row in rows[0]) == sum(row["successes"] for row in rows[3])


def test_searches_share_prefixes_only_of_egos_that_fork():
    forking, other = (
        brakecheck.search("acc", ego=ego, switches=1, starts=3)[0]
        for ego in (TwoSeconds, Configured(1.0))
    )
    assert forking["solved"] == other["solved"]
    assert forking["physics_steps"] < other["physics_steps"]


def broken(percept):
    raise RuntimeError("the gearbox is missing")


def test_an_exception_is_a_fault_with_its_traceback():
    with pytest.raises(FaultError) as raised:
        brakecheck.eval("acc", ego=broken, starts=5)
    text = str(raised.value)
    assert "RuntimeError: the gearbox is missing" in text
    assert 'raise RuntimeError("the gearbox is missing")' in text or "in broken" in text


def test_an_episode_with_a_fault_is_truncated_and_says_why():
    env = Env("acc", ego=broken)
    env.reset(seed=0)
    _, reward, terminated, truncated, info = env.step(0)
    assert (reward, terminated, truncated) == (0.0, False, True)
    assert info["verdict"] == "invalid" and "gearbox" in info["fault"]["message"]


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (None, "`control` answered None"),
        ("brake", "`control` answered 'brake'"),
        ("1.0", "`control` answered '1.0'"),
        (np.str_("1.0"), "`control` answered"),
        (True, "`control` answered True"),
        (np.bool_(True), "`control` answered"),
        ((True, 0.0), r"`control` answered (True, 0.0)"),
        ((0.0, False), r"`control` answered (0.0, False)"),
        ((0.0, 0.0, 0.0), "`control` answered (0.0, 0.0, 0.0)"),
        ([0.0, 0.0], "`control` answered [0.0, 0.0]"),
        (np.array([1.0]), "`control` answered array([1.])"),
        (np.array([1.0, 0.0]), "`control` answered array([1., 0.])"),
        (np.array(True), "`control` answered array(True)"),
        (1j, "`control` answered 1j"),
        ({}, "`control` answered {}"),
        (float("nan"), "not finite"),
        (np.float64("nan"), "not finite"),
        (float("-inf"), "not finite"),
        ((0.0, float("nan")), "not finite"),
        (-99.0, "beyond"),
    ],
)
def test_an_answer_that_is_no_command_is_a_fault(answer, says):
    env = Env("acc", ego=lambda percept: answer)
    env.reset(seed=0)
    *_, info = env.step(0)
    assert says in info["fault"]["message"]


@pytest.mark.parametrize(
    "answer",
    [-1, -1.0, np.float32(-1), np.int64(-1), np.array(-1.0), (-1, 0), brakecheck.Command(-1)],
)
def test_every_kind_of_number_is_a_command(answer):
    env = Env("acc", ego=lambda percept: answer)
    env.reset(seed=0)
    *_, info = env.step(0)
    assert info.get("fault") is None
    assert env.trace()["ego.speed"][-1] < env.trace()["ego.speed"][0]


@pytest.mark.parametrize("wrong", [True, "1", None, np.array([1.0])])
def test_a_command_is_made_of_numbers(wrong):
    with pytest.raises(InputError, match="is no number"):
        brakecheck.Command(wrong)
    with pytest.raises(InputError, match="is no number"):
        brakecheck.Command(0.0, wrong)


def test_a_constructor_that_fails_is_a_fault_too():
    class NeedsMore:
        def __init__(self, what):
            self.what = what

        def control(self, percept):
            return 0.0

    with pytest.raises(FaultError, match="missing 1 required positional argument"):
        brakecheck.eval("acc", ego=NeedsMore, starts=3)


@pytest.mark.parametrize("ego", [3, object(), []])
def test_what_cannot_drive_is_refused(ego):
    with pytest.raises(InputError, match="is no ego|is no program"):
        brakecheck.eval("acc", ego=ego, starts=3)


def test_nobody_drives_on_a_grid():
    with pytest.raises(InputError, match="no vehicle drives"):
        Env("grid", ego=two_seconds)


def test_somebody_who_presses_ctrl_c_inside_an_ego_is_heard():
    def pressed(percept):
        raise KeyboardInterrupt

    env = Env("acc", ego=pressed)
    with pytest.raises(KeyboardInterrupt):
        env.reset(seed=0)
        env.step(0)


def test_percepts_have_what_the_crate_s_have():
    seen = []

    def curious(percept):
        seen.append(percept)
        return (0.0, 0.0)

    env = Env("acc", ego=curious)
    env.reset(seed=0)
    env.step(0)
    percept = seen[0]
    assert percept.time_s == 0.0 and percept.sample_s == env.world.about["sample_s"]
    (other,) = percept.others
    assert percept.leader().headway_m == other.headway_m > 0
    assert percept.follower() is None and percept.light() is None and percept.lights == []
    assert repr(other).startswith('Seen(name="ado"')
    assert env.trace()["ego.speed"][0] == percept.own.speed_mps


def test_an_ego_that_keeps_state_gives_no_result_unless_each_episode_has_its_own():
    class Tired:
        """Weakens after six episodes."""

        def __init__(self):
            self.episodes = 0

        def reset(self, seed):
            self.episodes += 1

        def control(self, percept):
            lead = percept.leader()
            gap = lead.headway_m - 15.0 if lead else 0.0
            return max(-6.0, min(2.0, 0.2 * gap)) * (0.2 if self.episodes > 6 else 1.0)

    asked = {"ado": lambda obs: 0, "starts": 20}
    with pytest.raises(FaultError) as raised:
        brakecheck.eval("acc", ego=Tired, **asked)
    # The text is wrapped, with a bar before each further line.
    said = " ".join(str(raised.value).replace("│", " ").split())
    assert "keeps state over `reset`" in said

    class Fresh(Tired):
        fresh = True

    assert brakecheck.eval("acc", ego=Fresh, **asked)[0]["invalid"] == 0
