"""What callbacks and users note is kept exactly, or refused before work is lost."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from acl_gym import ACL, Crisp, CSVLog, QLearning
from acl_gym.utils.serialization import from_json, to_json
from tests.agents.reference_colony import chains

ROW = Crisp([np.arange(6.0)])

KEPT: dict[str, Any] = {
    "text": "run-7 \N{GREEK SMALL LETTER TAU} \ud800",
    "none": None,
    "truth": True,
    "list": [1, [2.5, None], "a"],
    "tuple": (1, (2, [3])),
    "dict": {"a": {"b": (1,)}, "": []},
    "not a number": math.nan,
    "infinite": -math.inf,
    "large": 10**300,
    "minus zero": -0.0,
    "array": np.arange(6.0).reshape(2, 3),
    "empty array": np.zeros((0, 4), np.float32),
    "array without axes": np.array(3, np.uint8),
    "big-endian array": np.arange(3, dtype=">i4"),
    "half": np.float16(0.1),
    "number of NumPy": np.int64(-(2**63)),
}
REFUSED: dict[str, Any] = {
    "set": {1},
    "object": object(),
    "complex": 1j,
    "path": Path("a"),
    "bytes": b"a",
    "objects": np.array([None]),
    "date": np.datetime64("2026-01-01"),
    "keys": {1: "a"},
    "key of ours": {"__tuple__": [1]},
    "deep": [[[1, {"a": {2}}]]],
    "huge": 10**5_000,
}
CIRCLE: list[Any] = []
CIRCLE.append(CIRCLE)
REFUSED["circle"] = CIRCLE


def agent(kind: Any = ACL) -> Any:
    more = {"tau0": 1e-3} if kind is ACL else {}
    return kind(chains(3), ROW, max_steps=9, seed=0, **more)


def assert_same(one: Any, other: Any) -> None:
    """The same values, NaN and arrays included; NumPy's numbers become Python's."""
    if isinstance(one, np.ndarray):
        assert isinstance(other, np.ndarray)
        assert (one.dtype.name, one.shape) == (other.dtype.name, other.shape)
        np.testing.assert_array_equal(one, other)
    elif isinstance(one, (list, tuple)):
        assert type(one) is type(other)
        assert len(one) == len(other)
        for pair in zip(one, other, strict=True):
            assert_same(*pair)
    elif isinstance(one, dict):
        assert list(one) == list(other)
        assert_same(list(one.values()), list(other.values()))
    elif isinstance(one, np.generic):
        assert one == other
    else:
        assert type(one) is type(other)
        assert repr(one) == repr(other)


@pytest.mark.parametrize("name", KEPT)
@pytest.mark.parametrize("kind", [ACL, QLearning])
def test_what_can_be_kept_is_kept(kind: Any, name: str, tmp_path: Path) -> None:
    value = KEPT[name]
    learner = agent(kind)
    learner.metadata = {"note": value}
    learner.learn(trials=2, callback=lambda _, row: row.update(note=value))
    loaded = kind.load(learner.save(tmp_path / "agent"), chains(3))
    assert_same(value, loaded.metadata["note"])
    for row in loaded.history:
        assert_same(value, row["note"])
    loaded.learn(trials=1)
    again = kind.load(loaded.save(tmp_path / "agent"))
    assert_same(value, again.metadata["note"])
    assert_same(value, again.history[0]["note"])


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_kept_is_refused_in_its_trial(name: str, tmp_path: Path) -> None:
    """With its key, and what was learned can be saved nevertheless."""
    learner = agent()

    def note(_: Any, row: Any) -> None:
        if row["trial"] == 2:
            row["good"] = 1.0
            row["note"] = REFUSED[name]

    with pytest.raises(TypeError, match=r"row\['note'\].* to be saved"):
        learner.learn(trials=9, callback=note)
    assert learner.trials == 2
    assert learner.history[1]["good"] == 1.0
    assert "note" not in learner.history[1]
    loaded = ACL.load(learner.save(tmp_path / "agent"), chains(3))
    loaded.learn(trials=1)
    learner.learn(trials=1)
    assert loaded.table.tobytes() == learner.table.tobytes()


@pytest.mark.parametrize("name", REFUSED)
def test_notes_that_cannot_be_kept_are_refused_before_learning(
    name: str, tmp_path: Path
) -> None:
    learner = agent()
    learner.metadata = {"a": [0, REFUSED[name]]}
    for use in (lambda: learner.learn(trials=1), lambda: learner.save(tmp_path / "a")):
        with pytest.raises(TypeError, match=r"metadata\['a'\]\[1\].* to be saved"):
            use()
    assert learner.trials == 0
    assert not list(tmp_path.iterdir())


def test_a_key_that_is_no_text_is_refused() -> None:
    learner = agent()
    with pytest.raises(TypeError, match="the keys of row must be text"):
        learner.learn(trials=2, callback=lambda _, row: row.update({3: 1.0}))
    assert 3 not in learner.history[0]


def test_a_row_changed_behind_our_back_is_named(tmp_path: Path) -> None:
    learner = agent().learn(trials=3)
    learner.history[1]["note"] = {1, 2}
    with pytest.raises(TypeError, match=r"history\[1\]\['note'\] must be numbers"):
        learner.save(tmp_path / "agent")


def test_measures_added_at_the_end_are_checked_as_well() -> None:
    from acl_gym import Callback

    class Late(Callback):
        def on_training_end(self, agent: Any) -> None:
            agent.history[-1]["late"] = object()

    learner = agent()
    with pytest.raises(TypeError, match=r"row\['late'\]"):
        learner.learn(trials=2, callback=Late())
    assert "late" not in learner.history[-1]


def test_a_log_takes_notes_of_all_kinds(tmp_path: Path) -> None:
    notes = iter(["a, b", None, np.arange(2)])
    log = CSVLog(tmp_path / "log.csv")
    agent().learn(trials=3, callback=[lambda _, row: row.update(note=next(notes)), log])
    lines = (tmp_path / "log.csv").read_text().splitlines()
    assert [line.partition(",")[0] for line in lines] == ["trial", "1", "2", "3"]
    assert lines[1].endswith('"a, b"')
    assert lines[3].endswith("[0 1]")


PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text()
    | arrays.arrays(arrays.scalar_dtypes().filter(lambda d: d.kind in "biu"), (2, 1)),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.tuples(inner, inner)
        | st.dictionaries(st.text(), inner, max_size=3)
    ),
    max_leaves=10,
)


@given(PLAIN)
@settings(max_examples=100, suppress_health_check=[HealthCheck.too_slow])
def test_json_and_back(value: Any) -> None:
    assert_same(value, from_json(to_json(value, "value")))


@pytest.mark.parametrize(
    "value",
    [
        {"__array__": "AAAA", "dtype": "object", "shape": [1]},
        {"__array__": "AAAA", "dtype": "float64", "shape": [1]},
        {"__array__": "", "dtype": "float64", "shape": [10**12]},
        {"__array__": "%", "dtype": "int8", "shape": [1]},
        {"__array__": 3, "dtype": "int8", "shape": [1]},
        {"__array__": ""},
        {"__tuple__": 3},
    ],
)
def test_nonsense_for_an_array_is_refused(value: Any) -> None:
    with pytest.raises((LookupError, TypeError, ValueError)):
        from_json(value)
