"""STL over arrays that numpy owns."""

import pickle

import numpy as np
import pandas
import pytest
from brakecheck import FormulaError, InputError
from brakecheck.stl import Formula

GAP = np.array([3.0, 2.0, 4.0, 1.0])


@pytest.mark.parametrize(
    ("text", "robustness"),
    [
        ("always (gap > 1.5)", -0.5),
        ("always[0, 2] (gap > 1.5)", 0.5),
        ("eventually[2, 3] (gap > 3)", 1.0),
        ("gap > 0 until gap > 3", 1.0),
    ],
)
def test_the_robustness_is_that_of_the_crate(text, robustness):
    assert Formula(text).robustness({"gap": GAP}) == robustness


def test_every_sample_has_one():
    formula = Formula("always[0, 1] (gap > 1.5)")
    assert formula.robustness_all({"gap": GAP}).tolist() == [0.5, 0.5, -0.5, -0.5]


def test_times_are_seconds():
    formula = Formula("always[0, 1] (gap > 1.5)")
    assert formula.robustness({"gap": GAP}, dt=0.5) == 0.5
    assert formula.robustness({"gap": GAP}, dt=1.0 / 3) == -0.5


def test_signals_come_as_frames_fields_lists_and_truths():
    formula = Formula("always (red implies gap > 1.5)")
    red = np.array([True, False, True, False])
    frame = pandas.DataFrame({"gap": GAP, "red": red})
    fields = np.array(list(zip(GAP, red)), dtype=[("gap", "f8"), ("red", "?")])
    for signals in [frame, fields, {"gap": GAP.tolist(), "red": red}]:
        assert formula.robustness(signals) == 1.5
    with pytest.raises(InputError, match="holds no named signals"):
        formula.robustness([1.0, 2.0])


def test_nothing_else_than_what_is_read_is_looked_at():
    signals = {"gap": GAP, "noise": np.array([np.nan]), "of": np.zeros(9)}
    assert Formula("always (gap > 0)").robustness(signals) == 1.0


@pytest.mark.parametrize(
    ("gap", "says"),
    [
        ([1.0, float("nan")], "`gap` is NaN at sample 1"),
        ([[1.0], [2.0]], "a signal is one number per sample"),
        (["a", "b"], "which are no numbers"),
    ],
)
def test_what_is_no_signal_is_refused(gap, says):
    with pytest.raises(InputError, match=says):
        Formula("always (gap > 0)").robustness({"gap": gap})


def test_signals_of_unequal_lengths_are_refused():
    with pytest.raises(InputError, match="`y` has 2 samples"):
        Formula("always (x > y)").robustness({"x": GAP, "y": GAP[:2]})


def test_a_mistake_is_drawn_with_a_caret():
    with pytest.raises(FormulaError) as raised:
        Formula("always[0, 2] (x => 1)")
    lines = str(raised.value).splitlines()
    assert lines[2].endswith("always[0, 2] (x => 1)")
    assert lines[3].index("^") == lines[2].index("1)")
    assert "help: `=>` is implication" in lines[4]


def test_an_unknown_signal_is_drawn_with_a_caret():
    with pytest.raises(FormulaError, match="(?s)gp.*\\^\\^"):
        Formula("always (gp > 1)").robustness({"gap": GAP})


def test_a_monitor_closes_in_on_the_robustness():
    formula = Formula("always (gap > 1.5)")
    monitor = formula.monitor(["gap"], samples=len(GAP))
    seen = [monitor.push({"gap": value}) for value in GAP]
    assert [interval.high for interval in seen] == [1.5, 0.5, 0.5, -0.5]
    assert seen[-1].is_final and monitor.finish() == formula.robustness({"gap": GAP})
    monitor.reset()
    assert len(monitor) == 0
    with pytest.raises(InputError, match="lacks: gap"):
        monitor.push({"gop": 1.0})


def test_many_samples_in_a_call_are_those_of_many_calls():
    formula = Formula("always eventually[0, 1] (gap > 1.5 and speed < 9)")
    gaps, speeds = [3.0, 2.0, 1.0, 1.2, 4.0], [1.0, 2.0, 3.0, 4.0, 10.0]
    names = ["gap", "speed"]
    single, many, table = (formula.monitor(names) for _ in range(3))
    expected = [tuple(single.push(list(row))) for row in zip(gaps, speeds)]
    ends = many.push_many({"speed": np.array(speeds), "gap": gaps, "unread": ["x"]})
    assert ends.shape == (5, 2) and [tuple(row) for row in ends] == expected
    assert [tuple(row) for row in table.push_many(np.column_stack([gaps, speeds]))] == expected
    assert many.finish() == single.finish() == table.finish()
    assert formula.monitor(names).push_many(np.empty((0, 2))).shape == (0, 2)


def test_a_wrong_row_among_many_takes_none_of_them():
    monitor = Formula("always (gap > 1.5)").monitor(["gap"])
    monitor.push([3.0])
    with pytest.raises(InputError, match="NaN|nan"):
        monitor.push_many(np.array([[1.0], [np.nan]]))
    assert len(monitor) == 1 and monitor.push([2.0]).high == 0.5
    with pytest.raises(InputError, match=r"shape \(3,\)"):
        monitor.push_many(np.array([1.0, 2.0, 3.0]))
    with pytest.raises(InputError, match="lacks: gap"):
        monitor.push_many({"gop": [1.0]})
    both = Formula("always (gap > speed)").monitor(["gap", "speed"])
    with pytest.raises(InputError, match="`gap` 2, `speed` 1"):
        both.push_many({"gap": [1.0, 2.0], "speed": [1.0]})


def test_constants_formulas_and_settings_are_taken():
    safe = Formula("always safe", constants={"d": 1.5}, formulas={"safe": "gap > d"})
    assert safe.robustness({"gap": GAP}) == -0.5
    assert Formula("always (gap > 9)", rho_max=2.0).robustness({"gap": GAP}) == -2.0
    strict = Formula("always[0, 9] (gap > 0)", end="strict")
    assert strict.robustness({"gap": GAP}) == -np.inf
    with pytest.raises(InputError, match="known: truncate, hold, strict"):
        Formula("gap > 0", end="never")


def test_an_explanation_names_leaf_time_and_values():
    found = Formula("always (gap > 1.5)").explain({"gap": GAP}, dt=0.5)
    assert found.robustness == -0.5 and found.signals == {"gap": 1.0}
    assert found.path[-1]["formula"] == "gap > 1.5" and found.path[-1]["time_s"] == 1.5
    assert "gap" in str(found)


def test_formulas_are_values():
    formula = Formula("G (gap > d)", constants={"d": 1.0})
    assert str(formula) == "always (gap > d)"
    assert pickle.loads(pickle.dumps(formula)) == formula
    assert formula != Formula("G (gap > d)", constants={"d": 2.0})


def test_contiguous_arrays_are_read_where_they_lie():
    from brakecheck.stl import _columns

    (_, _, column), (_, _, other) = _columns({"gap": GAP, "half": GAP[::2]})
    assert np.shares_memory(column, GAP) and not np.shares_memory(other, GAP)
