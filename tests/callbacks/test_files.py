"""The callbacks that stop training or leave files: best agent, checkpoints, logs."""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import (
    ACL,
    Callback,
    Checkpoint,
    CSVLog,
    EarlyStop,
    Fuzzy,
    PolicyEvaluation,
    QLearning,
    TensorBoardLog,
    evaluate_policy_cost,
)
from acl_gym.callbacks import Row

STATES = np.random.default_rng(0).uniform([0, -9], [6, 9], (12, 2))
BOTH = pytest.mark.parametrize("kind", [ACL, QLearning])


def pendulums() -> Any:
    return gym.make_vec("acl_gym/Pendulum-v0", num_envs=10)


def make(kind: type = ACL) -> Any:
    env = pendulums()
    grid = Fuzzy.from_box(env.single_observation_space, (6, 7), circular=[0])
    parameters = {"tau0": 1e-6} if kind is ACL else {}
    return kind(env, grid, max_steps=30, seed=0, **parameters)


def evaluation(**keywords: Any) -> PolicyEvaluation:
    return PolicyEvaluation(pendulums(), STATES, max_steps=25, **keywords)


def without_time(history: list[Row]) -> list[Row]:
    return [{**row, "seconds": 0.0} for row in history]


class Script(Callback):
    """Writes given values of a measure into the rows; None leaves it out."""

    def __init__(self, values: list[float | None], name: str = "policy_cost") -> None:
        self.values = values
        self.name = name

    def on_trial_end(self, agent: Any, row: Row) -> None:
        value = self.values[int(row["trial"]) - 1]
        if value is not None:
            row[self.name] = value


# --- the best agent ------------------------------------------------------------


@BOTH
def test_the_file_is_the_best_agent(kind: type, tmp_path: Path) -> None:
    watcher = evaluation(save_best=tmp_path / "best")
    costs = [
        row["policy_cost"]
        for row in make(kind).learn(trials=12, callback=watcher).history
    ]
    assert min(costs) < costs[-1]
    best = kind.load(tmp_path / "best")
    assert best.trials == 1 + int(np.argmin(costs))
    assert best.history[-1]["policy_cost"] == min(costs)
    again = evaluate_policy_cost(best, pendulums(), STATES, max_steps=25)
    assert again.cost == min(costs)
    assert [path.name for path in tmp_path.iterdir()] == ["best.npz"]


def test_a_loaded_agent_does_not_replace_a_better_one(tmp_path: Path) -> None:
    path = tmp_path / "best.npz"
    agent = make().learn(trials=12, callback=evaluation(save_best=path))
    agent.save(tmp_path / "last.npz")
    before = path.read_bytes()
    lowest = min(row["policy_cost"] for row in agent.history)
    later = ACL.load(tmp_path / "last.npz", pendulums())
    later.learn(trials=3, callback=evaluation(save_best=path))
    better = [r for r in later.history[12:] if r["policy_cost"] < lowest]
    assert (path.read_bytes() != before) == bool(better)
    assert ACL.load(path).history[-1]["policy_cost"] <= lowest


def test_a_second_run_writes_its_own_best(tmp_path: Path) -> None:
    """Also where the agent was better once, but that is in no file."""
    agent = make().learn(trials=2, callback=evaluation())
    agent.history[0]["policy_cost"] = -1.0
    agent.learn(trials=1, callback=evaluation(save_best=tmp_path / "best"))
    assert ACL.load(tmp_path / "best").trials == 3
    make(QLearning).learn(trials=1, callback=evaluation(save_best=tmp_path / "best"))
    assert QLearning.load(tmp_path / "best").trials == 1


def test_a_file_in_no_folder_is_refused_before_training(tmp_path: Path) -> None:
    for bad in (
        lambda path: evaluation(save_best=path),
        CSVLog,
    ):
        with pytest.raises(FileNotFoundError, match="there is no folder"):
            bad(tmp_path / "none" / "file")


@pytest.mark.parametrize(
    ("keywords", "message"),
    [({"policy": 3}, "policy must be"), ({"seed": "x"}, "seed must be an integer")],
)
def test_bad_arguments_of_an_evaluation(keywords: Any, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        evaluation(**keywords)
    with pytest.raises(TypeError, match="env must be a gymnasium"):
        PolicyEvaluation("x")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="seed must be at least 0"):
        evaluation(seed=-1)


# --- checkpoints ---------------------------------------------------------------


@BOTH
def test_going_on_from_a_checkpoint_is_going_on(kind: type, tmp_path: Path) -> None:
    unbroken = make(kind).learn(
        trials=20, callback=[evaluation(every=5), Checkpoint(tmp_path)]
    )
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["trial_000010.npz", "trial_000020.npz"]
    half = kind.load(tmp_path / "trial_000010.npz", pendulums())
    assert half.trials == 10
    half.learn(trials=10, callback=evaluation(every=5))
    assert half.table.tobytes() == unbroken.table.tobytes()
    assert half.num_timesteps == unbroken.num_timesteps
    assert without_time(half.history) == without_time(unbroken.history)
    assert half.rng.bit_generator.state == unbroken.rng.bit_generator.state


def test_the_last_trial_is_saved_with_its_whole_row(tmp_path: Path) -> None:
    folder = tmp_path / "made" / "here"
    agent = make().learn(
        trials=7, callback=[evaluation(every=4), Checkpoint(folder, every=3)]
    )
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["trial_000003.npz", "trial_000006.npz", "trial_000007.npz"]
    last = ACL.load(folder / "trial_000007.npz")
    assert last.history == agent.history
    assert "policy_cost" in last.history[-1]


def test_only_the_newest_are_kept(tmp_path: Path) -> None:
    (tmp_path / "trial_000900.npz").write_bytes(b"of another run")
    (tmp_path / "notes.txt").write_text("mine")
    make().learn(trials=7, callback=Checkpoint(tmp_path, every=1, keep=2))
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "notes.txt",
        "trial_000006.npz",
        "trial_000007.npz",
        "trial_000900.npz",
    ]


def test_a_broken_trial_is_not_saved(tmp_path: Path) -> None:
    agent = make()
    move = agent.rollout.move

    def breaking(actions: np.ndarray) -> Any:
        if agent.trials == 3 and agent.rollout.steps == 15:
            raise RuntimeError("half-way")
        return move(actions)

    agent.rollout.move = breaking
    with pytest.raises(RuntimeError, match="half-way"):
        agent.learn(trials=5, callback=Checkpoint(tmp_path, every=2))
    assert [path.name for path in tmp_path.iterdir()] == ["trial_000002.npz"]


@pytest.mark.parametrize("keywords", [{"every": 0}, {"keep": 0}, {"keep": -2}])
def test_bad_numbers_of_a_checkpoint(keywords: Any, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="must be at least 1"):
        Checkpoint(tmp_path, **keywords)


# --- stopping early ------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "keywords", "trials"),
    [
        ([5, 4, 4, 4, 3, 3], {"patience": 3}, 6),
        ([5, 4, 4, 4, 4, 1], {"patience": 3}, 5),
        ([5, 5, 5, 5, 5, 5], {"patience": 1}, 2),
        ([5, None, None, None, 5, 5], {"patience": 2}, 6),
        ([5, 4.5, 4, 3.5, 3, 2.5], {"patience": 2, "min_improvement": 0.9}, 6),
        ([5, 4.9, 4.8, 4.7, 4, 3], {"patience": 3, "min_improvement": 0.5}, 4),
        ([5, 4, 3, 2, 1, 0], {"patience": 9, "threshold": 3}, 3),
        ([math.nan, math.nan, math.nan, 1, 1, 1], {"patience": 2}, 2),
    ],
)
def test_it_stops_when_patience_is_at_an_end(
    values: Any, keywords: Any, trials: int
) -> None:
    agent = make().learn(trials=6, callback=[Script(values), EarlyStop(**keywords)])
    assert agent.trials == trials


@pytest.mark.parametrize("measure", ["policy_return", "ants_return", "success_rate"])
@pytest.mark.parametrize(
    ("values", "keywords", "trials"),
    [
        ([-5, -4, -4, -4, -3, -3], {"patience": 3}, 6),
        ([-5, -4, -4, -4, -4, -1], {"patience": 3}, 5),
        ([1, 1.5, 2, 2.5, 3, 3.5], {"patience": 2, "min_improvement": 0.9}, 6),
        ([1, 2, 3, 4, 5, 6], {"patience": 9, "threshold": 3}, 3),
    ],
)
def test_where_higher_is_better_it_waits_for_more(
    values: Any, keywords: Any, trials: int, measure: str
) -> None:
    stop = EarlyStop(measure=measure, **keywords)
    assert stop.best == -math.inf
    agent = make().learn(trials=6, callback=[Script(values, measure), stop])
    assert agent.trials == trials
    assert stop.best >= max(values) - keywords.get("min_improvement", 3)


def test_it_begins_anew_with_every_call() -> None:
    stop = EarlyStop(2, measure="mine")
    agent = make()
    agent.learn(trials=9, callback=[Script([1.0] * 20, "mine"), stop])
    assert agent.trials == 3
    agent.learn(trials=9, callback=[Script([1.0] * 20, "mine"), stop])
    assert agent.trials == 6
    assert stop.best == 1.0
    assert stop.waited == 2


def test_a_measure_that_never_comes_is_one_clear_error() -> None:
    with pytest.raises(ValueError, match=r"rows with 'policy_cost'.*PolicyEvaluation"):
        make().learn(trials=3, callback=EarlyStop(2))
    # Rare, but there: the last trial is always evaluated.
    make().learn(trials=3, callback=[evaluation(every=10), EarlyStop(2)])


def test_the_wrong_order_is_found_out() -> None:
    agent = make()
    with pytest.raises(ValueError, match="must come after the callback"):
        agent.learn(trials=9, callback=[EarlyStop(2), evaluation(every=2)])
    assert agent.trials == 3


def test_an_exception_is_not_hidden_by_the_missing_measure() -> None:
    def fail(agent: Any, row: Row) -> None:
        agent.in_trial = True
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        make().learn(trials=3, callback=[EarlyStop(2), fail])


@pytest.mark.parametrize(
    ("keywords", "error"),
    [
        ({"patience": 0}, ValueError),
        ({"patience": 1.5}, TypeError),
        ({"patience": 1, "min_improvement": -1}, ValueError),
        ({"patience": 1, "threshold": math.nan}, ValueError),
        ({"patience": 1, "measure": 3}, TypeError),
    ],
)
def test_bad_arguments_of_early_stop(keywords: Any, error: type[Exception]) -> None:
    with pytest.raises(error):
        EarlyStop(**keywords)


# --- CSV -----------------------------------------------------------------------


def read(path: Path) -> list[dict[str, float]]:
    with path.open(newline="") as file:
        return [
            {name: float(value) for name, value in row.items() if value != ""}
            for row in csv.DictReader(file)
        ]


def test_the_file_is_the_history(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    seen = []

    def look(agent: Any, row: Row) -> None:
        seen.append(read(log) == agent.history)

    agent = make().learn(trials=7, callback=[evaluation(every=3), CSVLog(log), look])
    assert seen == [True] * 7
    assert read(log) == agent.history
    lines = log.read_text().splitlines()
    assert len(lines) == 8
    assert lines[0].startswith("trial,env_steps,seconds,")
    assert lines[0].endswith("policy_cost,success_rate")
    assert lines[1].endswith(",,")
    assert lines[1].startswith("1,")


def test_going_on_after_a_load_repeats_nothing(tmp_path: Path) -> None:
    """Also when the log has gone on further than what was saved."""
    log = tmp_path / "log.csv"
    agent = make().learn(trials=4, callback=CSVLog(log))
    agent.save(tmp_path / "agent")
    agent.learn(trials=3, callback=CSVLog(log))
    assert [row["trial"] for row in read(log)] == [1, 2, 3, 4, 5, 6, 7]
    loaded = ACL.load(tmp_path / "agent", pendulums())
    loaded.learn(trials=2, callback=CSVLog(log))
    assert [row["trial"] for row in read(log)] == [1, 2, 3, 4, 5, 6]
    assert read(log) == loaded.history


def test_numpy_numbers_and_odd_names_can_be_read_back(tmp_path: Path) -> None:
    def add(agent: Any, row: Row) -> None:
        row['mine, "too"'] = np.float64(0.1)  # type: ignore[assignment]

    make().learn(trials=2, callback=[add, CSVLog(tmp_path / "log.csv")])
    assert [row['mine, "too"'] for row in read(tmp_path / "log.csv")] == [0.1, 0.1]


def test_a_file_of_something_else_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "thesis.tex"
    path.write_text("years of work\n")
    with pytest.raises(ValueError, match="is not a log"):
        CSVLog(path)
    with pytest.raises(IsADirectoryError, match="is a folder"):
        CSVLog(tmp_path)
    assert path.read_text() == "years of work\n"


# --- TensorBoard ---------------------------------------------------------------


class TestTensorBoard:
    @staticmethod
    def scalars(folder: Path) -> dict[str, list[tuple[int, float]]]:
        from tensorboard.backend.event_processing.event_accumulator import (
            EventAccumulator,
        )

        events = EventAccumulator(str(folder), size_guidance={"scalars": 0})
        events.Reload()
        return {
            tag: [(event.step, event.value) for event in events.Scalars(tag)]
            for tag in events.Tags()["scalars"]
        }

    def test_scalars_are_read_back(self, tmp_path: Path) -> None:
        agent = make().learn(
            trials=5,
            callback=[
                evaluation(every=2),
                Script([7.0] * 5, "mine"),
                TensorBoardLog(tmp_path),
            ],
        )
        found = self.scalars(tmp_path)
        tags = {
            "ants_cost": "cost/ants",
            "policy_cost": "cost/policy",
            "ants_success_rate": "success/ants",
            "success_rate": "success/policy",
            "policy_variation": "policy/variation",
            "sensitivity": "policy/sensitivity",
            "trial": "time/trial",
            "seconds": "time/seconds",
            "mine": "other/mine",
        }
        assert set(found) == set(tags.values())
        for name, tag in tags.items():
            rows = [row for row in agent.history if name in row]
            assert [step for step, _ in found[tag]] == [r["env_steps"] for r in rows]
            np.testing.assert_array_equal(
                [value for _, value in found[tag]],
                np.array([row[name] for row in rows], dtype=np.float32),
            )
        assert len(found["cost/policy"]) == 3

    def test_going_on_hides_what_was_beyond(self, tmp_path: Path) -> None:
        folder = tmp_path / "board"
        agent = make().learn(trials=2)
        agent.save(tmp_path / "two")
        agent.learn(trials=3, callback=TensorBoardLog(folder))
        loaded = ACL.load(tmp_path / "two", pendulums())
        loaded.learn(trials=2, callback=TensorBoardLog(folder))
        trials = [value for _, value in self.scalars(folder)["time/trial"]]
        assert trials == [3.0, 4.0]


def test_without_tensorboard_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(
        sys.modules, "tensorboard.summary.writer.event_file_writer", None
    )
    with pytest.raises(ModuleNotFoundError, match=r"pip install \"acl-gym\[tensorb"):
        TensorBoardLog(tmp_path)


def test_a_file_of_another_run_is_replaced_with_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "best.npz"
    agent = make().learn(trials=2, callback=evaluation())
    make(QLearning).learn(trials=1, callback=evaluation(save_best=path))
    watcher = evaluation(save_best=path)
    with pytest.warns(UserWarning, match="is not the best policy of this run"):
        agent.learn(trials=1, callback=watcher)
    assert ACL.load(path).trials == 3
    assert watcher.saved == agent.history[-1]
    again = evaluation(save_best=path)
    agent.learn(trials=1, callback=again)  # without a warning
    assert again.saved is not None
    assert again.saved["policy_cost"] == min(
        row["policy_cost"] for row in agent.history[2:]
    )


@pytest.mark.parametrize(
    ("directory", "error"), [(3, TypeError), (None, TypeError), ("", ValueError)]
)
@pytest.mark.parametrize("kind", [Checkpoint, TensorBoardLog])
def test_a_directory_that_is_none_is_refused(
    kind: Any, directory: Any, error: type[Exception]
) -> None:
    with pytest.raises(error, match="directory must"):
        kind(directory)
