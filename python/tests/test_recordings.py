"""Recordings from columns of numpy and pandas."""

import numpy as np
import pandas
import pytest
from brakecheck import InputError, Recording, World, fit_traffic


def frame():
    """A lead that brakes after 5 s, and its follower 30 m behind."""
    t = np.arange(300) * 0.05
    braking = np.clip(t - 5.0, 0.0, 1.0)
    lead_mps = 28.0 - 2.0 * braking
    lead_m = 134.0 + np.concatenate([[0.0], np.cumsum(lead_mps[:-1] * 0.05)])
    lead = pandas.DataFrame({"id": "lead", "t": t, "x": lead_m, "v": lead_mps})
    own = pandas.DataFrame({"id": "own", "t": t, "x": 100.0 + 28.0 * t, "v": 28.0})
    return pandas.concat([lead, own]).assign(y=0.0, length=4.0, width=1.8, kind="car")


def recording(table, **more):
    return Recording(
        table.id,
        table.t,
        table.x,
        table.y,
        speed_mps=table.v,
        length_m=table.length,
        width_m=table.width,
        classes=table.kind,
        **more,
    )


def test_a_frame_has_the_situations_of_its_rows_in_any_order():
    table = frame()
    summary = recording(table).summary()
    assert (summary["road_users"], summary["followings"]) == (2, 1)
    assert summary["counts"]["rows"] == 600
    shuffled = recording(table.sample(frac=1.0, random_state=3)).summary()
    assert shuffled["distance_km"] == pytest.approx(summary["distance_km"])
    assert shuffled["followings"] == 1


def test_numbers_are_identities_and_sizes_come_from_classes():
    t = np.arange(20) / 10
    walking = Recording(
        np.repeat([7, 9], 20), np.tile(t, 2), np.tile(t, 2), np.repeat([0.0, 5.0], 20),
        classes=np.repeat(["pedestrian", "bicycle"], 20),
    )
    summary = walking.summary()
    assert summary["counts"]["assumed_sizes"] == 2
    assert summary["carriageways"] == []


def test_rules_count_episodes_by_hand(tmp_path):
    # The gap is 30 m until 5 s and falls below 28 m after 6.5 s for good.
    rule = "always (lead.present implies ego.lead.gap >= 28)"
    [found] = recording(frame()).rules(rule)
    assert (found["rule"], found["episodes"], found["vehicles"]) == (rule, 1, 1)
    assert found["share"] == pytest.approx(170 / 600, abs=0.005)
    assert found["worst"]["id"] == "own"
    rules = tmp_path / "rules.ron"
    rules.write_text(f'RuleFile(rules: [Rule(name: "28 m", stl: "{rule}")])')
    [named] = recording(frame()).rules(rules)
    assert named == {**found, "rule": "28 m"}
    assert len(recording(frame()).rules()) == 10
    with pytest.raises(InputError, match="sped"):
        recording(frame()).rules("always (ego.sped > 3)")


def test_a_following_becomes_a_world(tmp_path):
    [world] = recording(frame(), name="drive").worlds(tmp_path, "follow", "following")
    assert isinstance(world, World)
    assert world.name == "follow"
    assert 'source: "drive"' in world.text
    with pytest.raises(InputError, match="there already"):
        recording(frame()).worlds(tmp_path, "follow", "following")
    with pytest.raises(InputError, match="no crossing"):
        recording(frame()).worlds(tmp_path, "cross", "crossing")
    with pytest.raises(InputError, match="unknown kind"):
        recording(frame()).worlds(tmp_path, "cross", "merging")


def test_too_little_driving_is_no_model(tmp_path):
    file = tmp_path / "traffic.ron"
    with pytest.raises(InputError):
        fit_traffic([recording(frame())], file)
    assert not file.exists()


def test_a_picture_is_an_svg():
    assert "<svg" in recording(frame(), name="drive").picture().splitlines()[1]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"x": np.nan}, "x_m"),
        ({"length": 0.0}, "length_m"),
        ({"kind": "tank"}, "tank"),
        ({"t": 1.0}, "two rows|twice|once|same"),
    ],
)
def test_a_wrong_column_is_named(change, says):
    with pytest.raises(InputError, match=says):
        recording(frame().assign(**change))


def test_columns_of_other_lengths_and_shapes_are_refused():
    one = np.zeros(3)
    with pytest.raises(InputError, match="y_m"):
        Recording(["a"] * 3, np.arange(3), one, np.zeros(2))
    with pytest.raises(InputError, match="dimensions"):
        Recording(["a"] * 3, np.arange(3), np.zeros((3, 1)), one)
    with pytest.raises(InputError, match="numbers"):
        Recording(["a"] * 3, ["x", "y", "z"], one, one)
    with pytest.raises(InputError, match="missing"):
        Recording(["a"] * 3, np.arange(3), one, one, length_m=one + 1)
