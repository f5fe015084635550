"""Environments: what Gymnasium and PettingZoo ask of them, and equal bits."""

import gymnasium
import numpy as np
import pytest
from brakecheck import Env, InputError, ParallelEnv, VectorEnv, World, replay
from gymnasium.utils.env_checker import check_env
from gymnasium.utils.save_video import save_video
from gymnasium.wrappers import RecordVideo
from pettingzoo.test import parallel_api_test

WORLDS = ["acc", "merge", "grid", "pedestrian", "yellow_light"]


@pytest.mark.filterwarnings("ignore:.*(infinity|not within|bounds).*")
@pytest.mark.parametrize("world", WORLDS)
def test_gymnasium_s_checks_pass(world):
    check_env(gymnasium.make(f"brakecheck/{world}-v0").unwrapped)


def test_every_shipped_world_has_an_id():
    ids = {f"brakecheck/{world}-v0" for world in World.shipped()}
    assert ids <= set(gymnasium.registry)


@pytest.mark.filterwarnings("ignore:no option of")
def test_pettingzoo_s_checks_pass_where_there_are_several_ados():
    env = ParallelEnv("sandwich")
    assert len(env.possible_agents) == 2
    parallel_api_test(env, num_cycles=200)


def test_the_actions_of_all_ados_make_the_joint_one():
    env = ParallelEnv("sandwich")
    labels = {ado["name"]: ado["actions"] for ado in env.world.about["ados"]}
    for each in np.ndindex(*(len(labels[name]) for name in env.possible_agents)):
        actions = dict(zip(env.possible_agents, each))
        words = " | ".join(labels[name][action] for name, action in actions.items())
        assert env.world.actions[env.joint(actions)] == words


def episode(env, actions, **reset):
    env.reset(**reset)
    for action in actions:
        obs, reward, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            return obs, reward, terminated, truncated, info
    raise AssertionError("the episode did not end")


def test_a_kept_crash_is_played_again_to_the_bit(kept):
    recorded = replay(kept, episode="acc-nominal-0001")[0]
    assert recorded.identical
    about = recorded.about
    env = Env("acc")
    options = {"start": about["start"], "noise": about["noise"], "aftermath": True}
    *_, info = episode(env, about["actions"], options=options)
    assert (info["verdict"], info["contact"]) == (about["verdict"], about["contact"])
    mine, theirs = env.trace(), recorded.trace()
    assert list(mine) == list(theirs)
    for name in mine:
        assert np.array_equal(mine[name], theirs[name]), name


def test_info_says_how_it_ended():
    env = Env("acc")
    _, reward, terminated, truncated, info = episode(env, [0] * 200, seed=1)
    assert (terminated, truncated) == (True, False)
    assert info["verdict"] == "foul" and info["broken_rule"] in info["rules"]
    assert info["rules"][info["broken_rule"]] <= 0 and reward <= -1
    assert info["fault"] is None and info["decisions"] > 0 and info["time_s"] > 0


def test_the_same_seed_begins_the_same_stream():
    env = Env("acc")
    first, second = env.reset(seed=3)[0], env.reset()[0]
    assert not np.array_equal(first, second)
    assert np.array_equal(env.reset(seed=3)[0], first)
    assert np.array_equal(env.reset(options={"index": 1})[0], second)
    assert not np.array_equal(env.reset(seed=3, options={"purpose": "test"})[0], first)


@pytest.mark.parametrize(
    ("play", "says"),
    [
        (lambda env: env.step(0), "call `reset`"),
        (lambda env: (env.reset(), env.step(99)), "99 is no action of"),
        (lambda env: env.reset(options={"start": [1.0]}), "are no start of"),
        (lambda env: env.reset(options={"strat": [1.0]}), "no option of `reset`: strat"),
        (lambda env: env.reset(options={"purpose": "fun"}), "known: train, calibration, test"),
    ],
)
def test_mistakes_are_refused_with_their_cure(play, says):
    with pytest.raises(ValueError, match=says):
        play(Env("acc"))


@pytest.mark.parametrize("action", [-1, 99, 1.0, 0.5, np.float32(1), np.nan, None, "1", [0, 1]])
def test_what_is_no_integer_of_the_action_space_is_refused(action):
    env = Env("acc")
    env.reset(seed=1)
    with pytest.raises(InputError, match=r"is no action of 3[\s\S]*the integers 0 to 2"):
        env.step(action)
    several = ParallelEnv("sandwich")
    several.reset(seed=1)
    first, second = several.possible_agents
    with pytest.raises(InputError, match=f"is no action of {second}: .* integers 0 to"):
        several.step({first: 0, second: action})
    with pytest.raises(InputError, match=f"no action of: {second}"):
        several.step({first: 0})
    vector = VectorEnv("acc", 2)
    vector.reset(seed=1)
    with pytest.raises(InputError, match=r"no action|give one for each of 2|give integers"):
        vector.step(np.array([0, action] if np.ndim(action) == 0 else [action, action]))
    # What was refused was not played.
    assert [len(env.trace()["time"]), len(several.trace()["time"])] == [1, 1]


def test_a_world_keeps_its_ego_where_something_else_is_changed():
    def timid(percept):
        return -1.0

    env = Env(World("acc", ego=timid), plant="kinematic")
    assert env.world.about["plant"] == "Kinematic" and "timid" in env.world.about["own_ego"]


def test_an_unknown_world_is_refused():
    with pytest.raises(InputError, match="no_such_world"):
        Env("no_such_world")


@pytest.mark.parametrize("plant", ["rigid", "kinematic"])
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_vector_environment_is_many_single_ones(jobs, plant):
    count, steps = 70, 60
    vector = VectorEnv("acc", count, jobs=jobs, plant=plant)
    singles = [Env("acc", plant=plant) for _ in range(count)]
    obs, _ = vector.reset(seed=5)
    over, ended = [False] * count, 0
    for i, env in enumerate(singles):
        assert np.array_equal(env.reset(seed=5 + i)[0], obs[i])
    rng = np.random.default_rng(0)
    for _ in range(steps):
        actions = rng.integers(vector.single_action_space.n, size=count)
        obs, rewards, terminated, truncated, infos = vector.step(actions)
        for i, env in enumerate(singles):
            if over[i]:
                want = (env.reset()[0], 0.0, False, False)
            else:
                *want, info = env.step(actions[i])
                if want[2] or want[3]:
                    assert infos["_verdict"][i] and infos["episode"][i] == info
                    for name in ("verdict", "is_success", "robustness", "decisions"):
                        assert infos[name][i] == info[name]
                    assert vector.trace(i).keys() == env.trace().keys()
                    for name, values in env.trace().items():
                        assert np.array_equal(vector.trace(i)[name], values)
            assert np.array_equal(obs[i], want[0])
            assert (rewards[i], terminated[i], truncated[i]) == tuple(want[1:])
            over[i] = bool(want[2] or want[3])
            ended += over[i]
    assert ended > count


def test_without_copies_the_buffers_are_always_the_same():
    vector = VectorEnv("acc", 3, copy=False)
    obs, _ = vector.reset(seed=0)
    again, *_ = vector.step([0, 0, 0])
    assert again is obs
    copied = VectorEnv("acc", 3)
    assert copied.step is not None and copied.reset(seed=0)[0] is not copied.reset()[0]


def test_gymnasium_makes_the_vector_environment():
    env = gymnasium.make_vec(
        "brakecheck/acc-v0", num_envs=4, vectorization_mode="vector_entry_point"
    )
    assert isinstance(env.unwrapped, VectorEnv) and env.num_envs == 4


@pytest.mark.parametrize("world", WORLDS)
def test_a_rendered_sample_is_an_image(world):
    assert Env(world).render() is None
    env = Env(world, render_mode="rgb_array")
    with pytest.raises(ValueError, match="call `reset` before `render`"):
        env.render()
    env.reset(seed=0)
    first = env.render()
    assert first.dtype == np.uint8 and first.shape == (288, 896, 3)
    # Shapes of many colours, and the same bits for the same sample.
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 20
    assert np.array_equal(env.render(), first)
    over = False
    while not over:
        _, _, terminated, truncated, _ = env.step(0)
        over = terminated or truncated
    last = env.render()
    assert last.shape == first.shape and not np.array_equal(last, first)
    # The verdict is at the bottom.
    assert not np.array_equal(last[-10:], first[-10:])


def test_a_video_plays_in_real_time(tmp_path):
    env = gymnasium.make("brakecheck/acc-v0", render_mode="rgb_array")
    decision_s = env.unwrapped.world.about["decision_s"]
    assert env.metadata["render_fps"] == pytest.approx(1 / decision_s)
    assert "rgb_array" in env.metadata["render_modes"]
    recorder = RecordVideo(env, str(tmp_path), episode_trigger=lambda _: True)
    recorder.reset(seed=0)
    for _ in range(5):
        recorder.step(0)
    frames = list(recorder.recorded_frames)
    recorder.close()
    assert len(frames) == 6 and not np.array_equal(frames[0], frames[5])
    assert [file.suffix for file in tmp_path.iterdir()] == [".mp4"]


@pytest.mark.parametrize("plant", ["rigid", "kinematic"])
def test_a_list_of_frames_has_every_sample(tmp_path, plant):
    env = gymnasium.make("brakecheck/acc-v0", plant=plant, render_mode="rgb_array_list")
    about = env.unwrapped.world.about
    assert env.metadata["render_fps"] == pytest.approx(1 / about["sample_s"])
    by_decision = Env("acc", plant=plant, render_mode="rgb_array")
    env.reset(seed=3)
    by_decision.reset(seed=3)
    [first] = env.render()
    assert np.array_equal(first, by_decision.render()) and env.render() == []
    frames, over = [], False
    per_decision = round(about["decision_s"] / about["sample_s"])
    while not over:
        both = [it.step(1) for it in (env, by_decision)]
        assert np.array_equal(both[0][0], both[1][0]) and both[0][1:] == both[1][1:]
        over = both[0][2] or both[0][3]
        new = env.render()
        assert len(new) == per_decision or (over and len(new) <= per_decision)
        assert np.array_equal(new[-1], by_decision.render())
        assert all(not np.array_equal(a, b) for a, b in zip(new, new[1:]))
        frames += new
    assert len(frames) + 1 == len(env.unwrapped.trace()["time"])
    save_video([first, *frames], str(tmp_path), fps=env.metadata["render_fps"])
    assert [file.suffix for file in tmp_path.iterdir()] == [".mp4"]
    # A new episode begins a new list.
    env.reset(seed=4)
    assert len(env.render()) == 1


@pytest.mark.parametrize("plant", ["rigid", "kinematic"])
def test_a_vector_environment_renders_as_single_ones(plant):
    vector = VectorEnv("acc", 2, plant=plant, render_mode="rgb_array")
    singles = [Env("acc", plant=plant, render_mode="rgb_array") for _ in range(2)]
    vector.reset(seed=5)
    for i, env in enumerate(singles):
        env.reset(seed=5 + i)
    for _ in range(3):
        vector.step([1, 2])
        for action, env in zip([1, 2], singles):
            env.step(action)
    frames = vector.render()
    assert isinstance(frames, tuple) and len(frames) == 2
    for frame, env in zip(frames, singles):
        assert np.array_equal(frame, env.render())
    assert VectorEnv("acc", 2).render() is None


def test_several_ados_are_rendered():
    env = ParallelEnv("sandwich", render_mode="rgb_array")
    env.reset(seed=0)
    assert env.render().shape == (288, 896, 3)
    assert env.metadata["name"] == "brakecheck_v0" and env.metadata["render_fps"] > 0


@pytest.mark.parametrize("make", [Env, ParallelEnv, VectorEnv])
def test_an_unknown_render_mode_is_refused(make):
    with pytest.raises(ValueError, match="`render_mode='human'` is not known; known: rgb_array"):
        make("sandwich", render_mode="human")


def test_natural_ados_are_limited_in_worlds_that_can_have_them():
    free = World("acc", plant="kinematic")
    limited = World("acc", plant="kinematic", natural=20.0)

    def braking(world):
        env = Env(world)
        env.reset(seed=3)
        for _ in range(10):
            *_, terminated, truncated, _ = env.step(0)
            if terminated or truncated:
                break
        return int((env.trace()["ado.accel"] < -2.5).sum())

    assert 0 < braking(limited) < braking(free)
    for wrong in ({"natural": 0.0}, {"natural": 1.0, "traffic": "none.ron"}):
        with pytest.raises(InputError):
            World("acc", **wrong)
    with pytest.raises(InputError, match="no ado drives a vehicle"):
        World("pedestrian", natural=1.0)


def test_a_world_is_changed_as_a_value(tmp_path):
    acc = World("acc")
    value = acc.value
    value["Scenario"]["name"] = "mine"
    mine = World.write(value, tmp_path / "mine.ron")
    assert (mine.name, mine.actions, mine.observation) == ("mine", acc.actions, acc.observation)
    assert mine.value == value
    value["Scenario"]["agents"][0]["Vehicle"]["body"] = "sedna"
    with pytest.raises(InputError, match="sedna"):
        World.write(value, tmp_path / "broken.ron")
    with pytest.raises(InputError, match="the value is no world"):
        World.write({"Scenario": {}}, tmp_path / "broken.ron")
    assert not (tmp_path / "broken.ron").exists()
