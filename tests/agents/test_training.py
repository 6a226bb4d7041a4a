"""The frame around learning: budget, rows, callbacks, log and progress."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from acl_gym import ACL, Callback, Crisp, QLearning
from acl_gym.agents.base import TabularAgent
from tests.agents import reference_colony as reference
from tests.agents.reference_colony import chains

ROW = Crisp([np.arange(6.0)])
BOTH = pytest.mark.parametrize("kind", [ACL, QLearning])


def make(kind: type[TabularAgent] = ACL, slots: int = 3, seed: int = 0) -> Any:
    parameters = {"tau0": 1e-3} if kind is ACL else {}
    return kind(chains(slots), ROW, max_steps=8, seed=seed, **parameters)


class Recorder(Callback):
    """Writes down what it is told, and stops or fails when it is told to."""

    def __init__(self, stop_after: int | None = None, fail_at: str = "") -> None:
        self.events: list[str] = []
        self.stop_after, self.fail_at = stop_after, fail_at

    def _note(self, event: str) -> None:
        self.events.append(event)
        if event == self.fail_at:
            raise RuntimeError(event)

    def on_training_start(self, agent: TabularAgent) -> None:
        self._note("start")

    def on_trial_end(self, agent: TabularAgent, row: dict[str, float]) -> bool | None:
        assert row is agent.history[-1]
        assert row["trial"] == agent.trials
        self._note(f"trial {agent.trials}")
        return None if self.stop_after is None else agent.trials < self.stop_after

    def on_training_end(self, agent: TabularAgent) -> None:
        self._note("end")


# --- budget --------------------------------------------------------------------


@BOTH
def test_a_budget_of_trials(kind: type) -> None:
    agent = make(kind).learn(trials=4)
    assert agent.trials == len(agent.history) == 4
    agent.learn(trials=3)
    assert agent.trials == 7


@BOTH
def test_a_budget_of_steps_is_a_lower_bound_met_by_the_last_trial(kind: type) -> None:
    agent = make(kind).learn(total_timesteps=100)
    before, after = (row["env_steps"] for row in agent.history[-2:])
    assert before < 100 <= after == agent.num_timesteps
    more = agent.num_timesteps + 50
    agent.learn(total_timesteps=np.int64(50))
    before, after = (row["env_steps"] for row in agent.history[-2:])
    assert before < more <= after


def test_a_budget_of_steps_that_is_met_exactly_ends_training() -> None:
    """Three ants that cannot reach the goal take 8 steps each."""
    grid = Crisp([np.arange(50.0)])
    agent = QLearning(chains(3, length=50, limit=8), grid, epsilon=0.0, seed=0)
    agent.set_table(np.tile([1.0, 0.0], (50, 1)))
    agent.learn(total_timesteps=48)
    assert (agent.trials, agent.num_timesteps) == (2, 48)


@pytest.mark.parametrize(("steps", "trials"), [(1, 5), (10**9, 2), (1, 1)])
def test_of_two_budgets_the_smaller_rules(steps: int, trials: int) -> None:
    agent = make().learn(steps, trials)
    assert agent.trials == (1 if steps == 1 else trials)


@BOTH
def test_without_a_budget_there_are_100_trials(kind: type) -> None:
    assert make(kind, slots=1).learn().trials == 100


@pytest.mark.parametrize("name", ["total_timesteps", "trials", "log_interval"])
@pytest.mark.parametrize(
    ("value", "error"),
    [
        (0, ValueError),
        (-3, ValueError),
        (1.5, TypeError),
        ("9", TypeError),
        (True, TypeError),
        (math.nan, TypeError),
    ],
)
def test_bad_budgets(name: str, value: Any, error: type[Exception]) -> None:
    agent, recorder = make(), Recorder()
    with pytest.raises(error, match=name):
        agent.learn(**{name: value}, callback=recorder)
    assert agent.trials == 0
    assert recorder.events == []


# --- rows ----------------------------------------------------------------------


@BOTH
def test_rows_hold_the_measures_of_their_trial(kind: type) -> None:
    agent = make(kind, slots=5, seed=2)
    policies = [agent.policy.best_actions()]
    seen: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def note(agent: TabularAgent, row: dict[str, float]) -> None:
        rollout = agent.rollout
        seen.append((rollout.cost.copy(), rollout.length.copy(), agent.table.copy()))
        policies.append(agent.policy.best_actions())

    agent.learn(trials=6, callback=note).learn(trials=4, callback=note)
    steps, seconds = 0, 0.0
    columns = {"trial", "env_steps", "seconds", "ants_cost", "ants_return"}
    columns |= {"policy_variation"} | ({"sensitivity"} if kind is ACL else set())
    for k, (row, (cost, length, table)) in enumerate(
        zip(agent.history, seen, strict=True)
    ):
        steps += length.sum()
        assert set(row) == columns
        assert row["trial"] == k + 1
        assert row["env_steps"] == steps
        assert row["seconds"] > seconds
        assert row["ants_cost"] == cost.mean() == length.mean()
        assert row["ants_return"] == -cost.mean()
        changed = np.mean(policies[k + 1] != policies[k])
        assert row["policy_variation"] == changed
        if kind is ACL:
            assert row["sensitivity"] == pytest.approx(
                reference.sensitivity(table, agent.alpha), rel=1e-12
            )
        seconds = row["seconds"]
    assert agent.num_timesteps == steps
    assert agent.seconds == seconds
    assert any(row["policy_variation"] > 0 for row in agent.history)


def test_rows_are_plain_numbers() -> None:
    for value in make().learn(trials=1).history[0].values():
        assert type(value) in (int, float)


# --- callbacks -----------------------------------------------------------------


@BOTH
def test_the_life_of_a_callback(kind: type) -> None:
    recorder = Recorder()
    make(kind).learn(trials=2, callback=recorder)
    assert recorder.events == ["start", "trial 1", "trial 2", "end"]


@BOTH
def test_a_callback_can_stop_training(kind: type) -> None:
    stopping, other = Recorder(stop_after=3), Recorder()
    agent = make(kind).learn(trials=9, callback=[stopping, other])
    assert agent.trials == 3
    assert (
        stopping.events
        == other.events
        == ["start", "trial 1", "trial 2", "trial 3", "end"]
    )
    assert agent.learn(trials=2).trials == 5


@pytest.mark.parametrize("answer", [False, np.False_])
def test_a_function_that_returns_false_stops_training(answer: Any) -> None:
    """A comparison of NumPy numbers gives NumPy's own False."""
    assert make().learn(trials=9, callback=lambda *_: answer).trials == 1


@pytest.mark.parametrize("answer", [None, True, 0, "", [], 0.0, np.True_])
def test_a_function_that_returns_anything_else_does_not(answer: Any) -> None:
    assert make().learn(trials=3, callback=lambda *_: answer).trials == 3


def test_callbacks_may_be_nested_and_mixed() -> None:
    recorder, calls = Recorder(), []
    function = lambda agent, row: calls.append(row["trial"])  # noqa: E731
    make().learn(trials=2, callback=(function, [recorder, [function]], None))
    assert calls == [1, 1, 2, 2]
    assert recorder.events[-1] == "end"


OF_ITSELF: list[Any] = [print]
OF_ITSELF.append(OF_ITSELF)


@pytest.mark.parametrize(
    "callback", [3, "print", [print, 3], {1: 2}, np.array(3), OF_ITSELF]
)
def test_what_is_no_callback_is_refused_at_once(callback: Any) -> None:
    agent = make()
    with pytest.raises(
        TypeError, match="callback must be a Callback object, a function"
    ):
        agent.learn(trials=1, callback=callback)
    assert agent.trials == 0


@BOTH
def test_after_an_exception_training_ends_and_the_rows_are_there(kind: type) -> None:
    recorder = Recorder(fail_at="trial 3")
    agent = make(kind)
    with pytest.raises(RuntimeError, match="trial 3"):
        agent.learn(trials=9, callback=recorder)
    assert recorder.events == ["start", "trial 1", "trial 2", "trial 3", "end"]
    assert [row["trial"] for row in agent.history] == [1, 2, 3]
    assert agent.learn(trials=2).trials == 5


def test_an_interrupted_trial_is_not_counted() -> None:
    """A reward of NaN in the fifth trial: four rows, and the end is announced."""
    recorder, agent = Recorder(), make()

    def spoil(agent: TabularAgent, row: dict[str, float]) -> None:
        if row["trial"] == 4:
            agent.env.envs[0].reward = math.nan  # type: ignore[union-attr]

    with pytest.raises(ValueError, match="finite"):
        agent.learn(trials=9, callback=[recorder, spoil])
    assert recorder.events[-2:] == ["trial 4", "end"]
    assert agent.trials == len(agent.history) == 4
    assert agent.num_timesteps == agent.history[-1]["env_steps"]


def test_time_in_callbacks_is_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    monkeypatch.setattr("time.perf_counter", lambda: clock[0])

    class Slow(Callback):
        def on_training_start(self, agent: TabularAgent) -> None:
            clock[0] += 100.0

        on_training_end = on_training_start

        def on_trial_end(self, agent: TabularAgent, row: Any) -> None:
            clock[0] += 100.0

    agent = make()
    start = agent.rollout.start

    def counted(**arguments: Any) -> np.ndarray:
        clock[0] += 1.0
        return start(**arguments)

    monkeypatch.setattr(agent.rollout, "start", counted)
    agent.learn(trials=3, callback=Slow()).learn(trials=1, callback=Slow())
    assert [row["seconds"] for row in agent.history] == [1.0, 2.0, 3.0, 4.0]


# --- log and progress ----------------------------------------------------------


def test_without_asking_nothing_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    make().learn(trials=3)
    assert capsys.readouterr() == ("", "")


@BOTH
def test_a_line_every_so_many_trials(
    kind: type, capsys: pytest.CaptureFixture[str]
) -> None:
    agent = make(kind).learn(trials=7, log_interval=3)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2
    for line, row in zip(lines, agent.history[2::3], strict=False):
        assert line.startswith(f"trial {row['trial']:>4}")
        assert f"{row['env_steps']:,}" in line
        assert f"ants' return {row['ants_return']:.1f}" in line
        assert "cost" not in line


@BOTH
@pytest.mark.parametrize(
    ("budget", "total"), [({"trials": 4}, "4/4"), ({"total_timesteps": 60}, "60.0")]
)
def test_the_progress_bar_goes_to_standard_error(
    kind: type, budget: dict[str, int], total: str, capsys: pytest.CaptureFixture[str]
) -> None:
    make(kind).learn(**budget, progress_bar=True)
    out, err = capsys.readouterr()
    assert out == ""
    assert kind.__name__ in err
    assert total in err
    assert "ants' return" in err


def test_a_policy_cost_that_a_callback_adds_is_shown(
    capsys: pytest.CaptureFixture[str],
) -> None:
    make().learn(
        trials=1, log_interval=1, callback=lambda _, row: row.update(policy_cost=12.34)
    )
    assert "policy cost 12.3" in capsys.readouterr().out


def test_the_bar_is_closed_after_an_exception(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(RuntimeError):
        make().learn(trials=3, callback=Recorder(fail_at="trial 2"), progress_bar=True)
    assert capsys.readouterr().err.endswith("\n")
