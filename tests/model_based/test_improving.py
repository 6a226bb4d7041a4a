"""Learning in a model until the policy no longer becomes better, and keeping the best."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acl_gym import (
    LearnedVectorEnv,
    QLearning,
    ReturningACL,
    Transitions,
    VectorEnvAdapter,
    evaluate_policy_cost,
)
from acl_gym.model_based.improving import LEAST_CHUNK, Improving
from tests.model_based.plants import pendulum

STATES = np.random.default_rng(0).uniform([-3.0, -8.0], [3.0, 8.0], (50, 2))


@pytest.fixture(scope="module")
def model() -> LearnedVectorEnv:
    return LearnedVectorEnv(
        Transitions.record(pendulum(), 100, hold=3, seed=0),
        20,
        goal=[np.pi, 0.0],
        tolerance=[0.1, 0.1],
        cost=([1.0, 0.1], 0.05),
    )


class Turning:
    """An agent of another package: its actions are worse after the second chunk."""

    def __init__(self, env: Any) -> None:
        self.env = env
        self.chunks = 0

    def learn(self, total_timesteps: int) -> None:
        self.chunks += 1

    def predict(self, observation: Any, **how: Any) -> Any:
        # Pushing with the motion swings the pendulum up, no torque does not.
        pushing = np.where(observation[:, 1] > 0, 2, 0)
        return (pushing if self.chunks == 2 else np.ones_like(pushing)), None


class Fixed(Turning):
    """One that cannot be copied."""

    def __deepcopy__(self, memo: Any) -> Any:
        raise TypeError("it holds a socket")


def cost(policy: Any, model: LearnedVectorEnv) -> float:
    return evaluate_policy_cost(policy, model, STATES).cost


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_policy_is_the_best_one_and_no_longer_changes(
    model: LearnedVectorEnv, tmp_path: Path, seed: int
) -> None:
    file = tmp_path / "best.npz"
    improving = Improving(lambda env: QLearning(env, seed=seed), file)
    improving.improve(model, STATES, 4 * LEAST_CHUNK)
    best: Any = improving.best
    assert not np.shares_memory(best.table, improving.agent.policy.table)
    kept = QLearning.load(file).policy
    np.testing.assert_array_equal(best.table, kept.table)
    before = best.table.copy()
    improving.agent.learn(total_timesteps=2_000)
    assert (improving.agent.table != before).any()
    np.testing.assert_array_equal(best.table, before)
    assert cost(best, model) == improving.cost == cost(kept, model)


def test_the_best_policy_of_an_agent_of_another_package_is_kept(
    model: LearnedVectorEnv,
) -> None:
    improving = Improving(Turning, None)
    improving.improve(model, STATES, 5 * LEAST_CHUNK)
    best: Any = improving.best
    assert improving.agent.chunks > 2
    assert best.chunks == 2
    assert best.env is model  # the model itself is not copied
    assert improving.cost == cost(best, model) < cost(improving.agent, model)


def test_an_agent_that_cannot_be_copied_gives_its_last_policy(
    model: LearnedVectorEnv, caplog: pytest.LogCaptureFixture
) -> None:
    improving = Improving(Fixed, None)
    improving.improve(model, STATES, 5 * LEAST_CHUNK)
    assert improving.best is improving.agent
    assert improving.cost == cost(improving.agent, model)
    (said,) = [r.getMessage() for r in caplog.records]
    assert "Fixed cannot be copied (it holds a socket)" in said


def test_of_an_agent_of_stable_baselines_the_networks_are_kept(
    model: LearnedVectorEnv,
) -> None:
    from stable_baselines3 import DQN

    def make(env: Any) -> Any:
        return DQN(
            "MlpPolicy",
            VectorEnvAdapter(env),
            learning_starts=10,
            policy_kwargs={"net_arch": [8]},
            device="cpu",
            seed=0,
        )

    improving = Improving(make, None)
    improving.improve(model, STATES, 300)
    best: Any = improving.best
    assert isinstance(best, type(improving.agent.policy))  # without the replay buffer
    before = [p.detach().clone() for p in best.parameters()]
    improving.agent.learn(total_timesteps=300)
    now = list(improving.agent.policy.parameters())
    assert any((a != b).any() for a, b in zip(before, now, strict=True))
    assert all((a == b).all() for a, b in zip(before, best.parameters(), strict=True))
    assert best.predict(STATES)[0].shape == (50,)


def learned_model(steps: int, *, heavier: bool = False) -> LearnedVectorEnv:
    """A model of the pendulum, or of one that falls twice as fast."""
    recorded = Transitions.record(pendulum(), steps, hold=3, seed=0)
    after = recorded.next_states
    if heavier:
        after = np.stack(
            [after[:, 0], 2.0 * after[:, 1] - recorded.states[:, 1]], axis=1
        )
    recorded = Transitions(recorded.states, recorded.inputs, after, circular=[0])
    return LearnedVectorEnv(
        recorded,
        20,
        goal=[np.pi, 0.0],
        tolerance=[0.1, 0.1],
        cost=([1.0, 0.1], 0.05),
        low=[-np.pi, -9.0],
        high=[np.pi, 9.0],
    )


def test_a_colony_goes_on_in_a_model_that_agrees_with_the_one_before() -> None:
    improving = Improving(lambda env: ReturningACL(env, seed=0), None)
    improving.improve(learned_model(80), STATES, LEAST_CHUNK)
    colony = improving.agent
    improving.improve(learned_model(120), STATES, LEAST_CHUNK)
    assert improving.agent is colony
    assert colony.num_timesteps >= 2 * LEAST_CHUNK


def test_a_new_colony_learns_in_a_model_that_contradicts_the_one_before() -> None:
    improving = Improving(lambda env: ReturningACL(env, seed=0), None)
    improving.improve(learned_model(80), STATES, LEAST_CHUNK)
    colony = improving.agent
    other = learned_model(80, heavier=True)
    steps = improving.improve(other, STATES, 4 * LEAST_CHUNK)
    assert improving.agent is not colony
    assert improving.agent.env is other
    # It begins, so that no round of its own ends early.
    assert steps == 4 * LEAST_CHUNK


def test_a_colony_that_was_given_forgets_its_paths_in_a_model_that_was_wrong() -> None:
    first = learned_model(80)
    colony = ReturningACL(first, seed=0)
    improving = Improving(colony, None)
    improving.improve(first, STATES, LEAST_CHUNK)
    forgot = []
    colony.forget = lambda: forgot.append(True)  # type: ignore[method-assign]
    improving.improve(learned_model(80, heavier=True), STATES, LEAST_CHUNK)
    assert improving.agent is colony
    assert forgot


def test_what_a_later_policy_may_cost_more_does_not_add_up(
    model: LearnedVectorEnv, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("acl_gym.model_based.improving.DOUBT", 1e6)  # the most: 10%
    costs = iter([100.0, 109.0, 118.0, 109.9, 111.0, 99.9])
    monkeypatch.setattr(Improving, "_cost", lambda *_: next(costs))
    improving = Improving(Turning, None)
    taken: list[int] = []
    snapshot = improving._snapshot

    def taking() -> Any:
        taken.append(improving.agent.chunks)
        return snapshot()

    monkeypatch.setattr(improving, "_snapshot", taking)
    improving.improve(model, STATES, 6 * LEAST_CHUNK)
    assert taken == [1, 2, 4, 6]
    assert improving.cost == 99.9
