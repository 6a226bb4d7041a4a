"""Tables of measurements and Minari's data sets become transitions."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest

from acl_gym import Transitions
from acl_gym.envs.learned import DataWarning

COLUMNS: dict[str, Any] = {"state": ["theta", "omega"], "input": "u"}


def table(rows: int = 50, seed: int = 0) -> pd.DataFrame:
    """A run of the pendulum, as a data logger writes it."""
    env = gym.make("acl_gym/Pendulum-v0")
    rng = np.random.default_rng(seed)
    seen, _ = env.reset(seed=seed)
    lines = []
    for row in range(rows):
        action = int(rng.integers(3))
        lines.append([row * 0.1, *seen, (-0.8, 0.0, 0.8)[action]])
        seen, *_ = env.step(action)
    return pd.DataFrame(lines, columns=["t", "theta", "omega", "u"])


def test_a_step_leads_from_each_row_to_the_next() -> None:
    frame = table()
    data = Transitions.from_frame(frame, **COLUMNS, time="t", circular=["theta"])
    assert len(data) == 49
    assert data.state_names == ("theta", "omega")
    assert data.sampling_time == pytest.approx(0.1)
    np.testing.assert_array_equal(data.states[1:], data.next_states[:-1])
    np.testing.assert_array_equal(data.inputs[:, 0], frame["u"][:-1])
    assert np.abs(data.states[:, 0]).max() <= np.pi


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_files_are_read_as_frames_are(kind: str, tmp_path: Path) -> None:
    frame, path = table(), tmp_path / f"run.{kind}"
    if kind == "csv":
        frame.to_csv(path, index=False)
    else:
        frame.to_parquet(path)
    read = getattr(Transitions, f"from_{kind}")
    found, other = read(path, **COLUMNS), Transitions.from_frame(frame, **COLUMNS)
    np.testing.assert_array_equal(found.states, other.states)
    several = read([path, path], **COLUMNS)
    assert len(several) == 98
    assert several.episodes.tolist() == [0] * 49 + [1] * 49


@pytest.mark.parametrize(
    ("separator", "decimal"), [(";", "."), ("\t", "."), (";", ","), (", ", ".")]
)
def test_columns_may_be_separated_in_other_ways(
    separator: str, decimal: str, tmp_path: Path
) -> None:
    frame, path = table(), tmp_path / "run.csv"
    lines = [separator.join(frame.columns)]
    for row in frame.to_numpy():
        lines.append(separator.join(repr(float(v)).replace(".", decimal) for v in row))
    path.write_text("\n".join(lines) + "\n")
    found = Transitions.from_csv(path, **COLUMNS)
    np.testing.assert_array_equal(
        found.states, Transitions.from_frame(frame, **COLUMNS).states
    )


def test_a_gap_in_time_ends_a_run() -> None:
    frame = table().drop(index=[20, 21])
    with pytest.warns(DataWarning, match="there is 1 gap in time"):
        data = Transitions.from_frame(frame, **COLUMNS, time="t")
    assert len(data) == 46
    assert np.bincount(data.episodes).tolist() == [19, 27]


def test_an_uneven_clock_is_told_from_gaps() -> None:
    frame = table(200)
    frame["t"] += np.random.default_rng(0).uniform(-0.012, 0.012, 200)
    with pytest.warns(
        DataWarning, match="the clock of this recording is uneven"
    ) as told:
        data = Transitions.from_frame(frame, **COLUMNS, time="t")
    words = str(told[0].message)
    assert f"{199 - len(data)} of 199 steps are longer or shorter" in words
    assert "Interpolate its rows to even times" in words


def test_dates_are_a_time() -> None:
    frame, seconds = table(), Transitions.from_frame(table(), **COLUMNS, time="t")
    for times in (
        pd.to_datetime(1.7e9 + frame["t"], unit="s").dt.round("ms"),
        pd.to_datetime(1.7e9 + frame["t"], unit="s", utc=True).dt.round("ms"),
        pd.to_timedelta(frame["t"], unit="s"),
    ):
        data = Transitions.from_frame(frame.assign(t=times), **COLUMNS, time="t")
        assert data.sampling_time == pytest.approx(0.1)
        np.testing.assert_array_equal(data.states, seconds.states)


def test_names_of_columns_may_be_numbers() -> None:
    frame = table()
    named = Transitions.from_frame(frame, **COLUMNS, time="t")
    bare = pd.DataFrame(frame.to_numpy())
    for state, u, time in (([1, 2], 3, 0), (["1", "2"], "3", "0")):
        data = Transitions.from_frame(bare, state=state, input=u, time=time)
        np.testing.assert_array_equal(data.states, named.states)
        assert data.state_names == ("1", "2")


def test_names_may_be_given_anew() -> None:
    names = {"state_names": ["angle, rad", "speed, rad/s"], "input_names": ["torque"]}
    data = Transitions.from_frame(table(), **COLUMNS, **names)
    assert data.state_names == ("angle, rad", "speed, rad/s")
    assert data.input_names == ("torque",)


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("states", "got 'states'. Did you mean 'state'?"),
        ("cicular", "got 'cicular'. Did you mean 'circular'?"),
        ("next_states", "Did you mean 'next_state'?"),
        ("xyz", "got 'xyz'."),
    ],
)
def test_arguments_that_are_misspelt_are_named(argument: str, words: str) -> None:
    with pytest.raises(TypeError) as caught:
        Transitions.from_frame(table(), input="u", **{argument: ["theta", "omega"]})
    assert str(caught.value).endswith(words)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16"])
def test_files_of_older_programs_are_read(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("t;Winkel °;w;u\n0,0;1,0;2,0;1\n0,1;1,2;2,1;0\n", encoding=encoding)
    data = Transitions.from_csv(path, state=["Winkel °", "w"], input="u", time="t")
    np.testing.assert_allclose(data.states, [[1.0, 2.0]])


def test_numbers_of_several_types_are_read() -> None:
    expected = Transitions.from_frame(table(), **COLUMNS)
    found = Transitions.from_frame(table().astype(object), **COLUMNS)
    assert (found.states == expected.states).all()
    large = table().astype(object).assign(u=10**400)
    with pytest.raises(
        ValueError, match=r"\['u'\] of the frame must be finite, got \[inf"
    ):
        Transitions.from_frame(large, **COLUMNS)


def test_a_file_of_one_row_has_no_sampling_time(tmp_path: Path) -> None:
    paths = tmp_path / "long.csv", tmp_path / "short.csv"
    table().to_csv(paths[0], index=False)
    table()[:1].to_csv(paths[1], index=False)
    found = Transitions.from_csv(list(paths), **COLUMNS, time="t")
    whole = Transitions.from_csv(paths[0], **COLUMNS, time="t")
    assert (len(found), found.sampling_time) == (len(whole), whole.sampling_time)


def test_a_column_tells_runs_apart() -> None:
    frame = pd.concat([table(10), table(20, seed=1)])
    frame["run"] = ["a"] * 10 + ["b"] * 20
    data = Transitions.from_frame(frame, **COLUMNS, time="t", run="run")
    assert np.bincount(data.episodes).tolist() == [9, 19]


def test_rows_may_be_steps_already() -> None:
    frame = table()
    for name in ("theta", "omega"):
        frame[f"next_{name}"] = frame[name].shift(-1).fillna(0.0)
    frame["r"], frame["end"] = -1.0, [False] * 49 + [True]
    data = Transitions.from_frame(
        frame,
        **COLUMNS,
        next_state=["next_theta", "next_omega"],
        reward="r",
        terminated="end",
    )
    assert len(data) == 50
    assert data.terminated is not None
    assert data.terminated.tolist() == [False] * 49 + [True]
    assert (data.rewards == -1.0).all()


@pytest.mark.parametrize(
    ("change", "columns", "message"),
    [
        (lambda f: f.rename(columns={"u": "v"}), {}, "must have a column 'u', got"),
        (lambda f: f.assign(u="on"), {}, r"must hold numbers, got \['on'\] in row 0"),
        (
            lambda f: f.assign(u=["0.5"] * 7 + ["off"] * 43),
            {},
            r"column 'u' of the frame must hold numbers, got \['off'\] in row 7",
        ),
        (lambda f: f, {"input": ["omega"]}, r"got \['omega'\] as both"),
        (lambda f: f, {"sampling_time": -1.0}, "sampling_time must lie in"),
        (lambda f: f.assign(omega=np.nan), {}, r"must be finite, got .* in row 0"),
        (lambda f: f.iloc[::-1], {"time": "t"}, "must increase"),
        (lambda f: pd.concat([f, f]), {"time": "t"}, "must increase"),
        (lambda f: f[:1], {}, "two rows or more that follow each other"),
        (
            lambda f: f.assign(run=np.where(f.index < 20, np.nan, 1.0)),
            {"run": "run"},
            r"which run each row belongs to, got nothing in row 0 \(20 rows of 50 are empty\)",
        ),
        (
            lambda f: f.assign(run=["a"] * 49 + [None]),
            {"run": "run"},
            "got nothing in row 49",
        ),
        (
            lambda f: f.assign(omega=pd.to_datetime(f.t, unit="s")),
            {},
            r"column 'omega' of the frame must hold numbers, got dates or times",
        ),
        (
            lambda f: f.assign(t=pd.to_datetime(f.t.where(f.t > 0.35), unit="s")),
            {"time": "t"},
            r"must be finite, got \[nan\] in row 0",
        ),
        (
            lambda f: f.rename(columns={"u": "u, V"}),
            {},
            "a name with a comma stands in double quotes, such as '\"u, V\"'",
        ),
        (lambda f: f[:0], {}, "two rows or more|array of real numbers"),
        (lambda f: f, {"state": []}, "state must be names of columns"),
        (lambda f: f, {"input": None}, "input must be names of columns"),
        (lambda f: f, {"state": ["u", "u"]}, "each column once"),
        (lambda f: f, {"next_state": ["u"]}, "next_state must name a column for each"),
        (lambda f: f, {"terminated": "u"}, "terminated needs next_state or run"),
    ],
)
def test_bad_tables_get_one_clear_error(
    change: Any, columns: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Transitions.from_frame(change(table()), **{**COLUMNS, **columns})


def test_files_that_are_none_get_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="there is no file"):
        Transitions.from_csv(tmp_path / "none.csv", **COLUMNS)
    path = tmp_path / "run.parquet"
    path.write_bytes(b"theta,omega,u")
    with pytest.raises(ValueError, match="must be a parquet file"):
        Transitions.from_parquet(path, **COLUMNS)
    (tmp_path / "empty.csv").write_bytes(b"")
    with pytest.raises(ValueError, match="must be a csv file"):
        Transitions.from_csv(tmp_path / "empty.csv", **COLUMNS)
    with pytest.raises(ValueError, match="an empty list"):
        Transitions.from_csv([], **COLUMNS)
    with pytest.raises(TypeError, match="a pandas frame is needed"):
        Transitions.from_frame([1, 2], **COLUMNS)


class TestMinari:
    """A data set that Minari itself collected."""

    @pytest.fixture
    def dataset(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
        minari = pytest.importorskip("minari")
        from minari.data_collector import EpisodeBuffer

        monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
        env, buffers = gym.make("CartPole-v1"), []
        env.action_space.seed(0)
        for seed in range(3):
            seen, _ = env.reset(seed=seed)
            kept: dict[str, list[Any]] = {"observations": [seen]}
            ended = False
            while not ended:
                action = env.action_space.sample()
                seen, reward, terminated, truncated, _ = env.step(action)
                ended = terminated or truncated
                for name, value in (
                    ("observations", seen),
                    ("actions", action),
                    ("rewards", reward),
                    ("terminations", terminated),
                    ("truncations", truncated),
                ):
                    kept.setdefault(name, []).append(value)
            arrays = {name: np.array(values) for name, values in kept.items()}
            buffers.append(EpisodeBuffer(**arrays))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # nobody is named as author
            return minari.create_dataset_from_buffers(
                "cartpole/random-v0", buffers, env=env
            )

    def test_a_data_set_is_read(self, dataset: Any) -> None:
        data = Transitions.from_minari(dataset)
        assert len(data) == dataset.total_steps
        assert data.description.numbered
        assert data.terminated is not None
        assert data.terminated.sum() == 3
        assert len(data.starts) == 3
        by_name = Transitions.from_minari(
            "cartpole/random-v0", state_names=list("abcd")
        )
        np.testing.assert_array_equal(by_name.states, data.states)
        assert by_name.state_names == ("a", "b", "c", "d")

    @pytest.mark.parametrize("name", ["cartpole/randon-v0", "a b", "..", "x" * 300])
    def test_an_id_that_is_none_is_one_error(self, dataset: Any, name: str) -> None:
        with pytest.raises((FileNotFoundError, ValueError)) as caught:
            Transitions.from_minari(name)
        said = str(caught.value)
        assert "of Minari" in said
        assert ("minari.download_dataset" in said) or ("cannot be read" in said)
        assert ("Did you mean 'cartpole/random-v0'?" in said) == ("randon" in name)
        assert caught.value.__cause__ is not None

    def test_a_data_set_that_is_damaged_is_one_error(self, dataset: Any) -> None:
        for file in Path(dataset.storage.data_path).iterdir():
            file.write_bytes(b"{")
        with pytest.raises(ValueError, match=r"of Minari cannot be read: .*again\."):
            Transitions.from_minari("cartpole/random-v0")

    def test_what_is_no_data_set_is_refused(self) -> None:
        with pytest.raises(TypeError, match=r"must be a minari\.MinariDataset"):
            Transitions.from_minari(3)
