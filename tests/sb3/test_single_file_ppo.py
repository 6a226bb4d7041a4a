"""Proximal policy optimisation in one file, as people write it around `make_vec`.

Schulman et al. (2017), with generalised advantages (2016). The step after the end of an
episode only resets a slot (NEXT_STEP); such steps are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium import spaces
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from torch import Tensor, nn
from torch.distributions import Categorical

DISCOUNT, TRACE, CLIP = 0.99, 0.95, 0.2
N_STEPS, EPOCHS, BATCH = 32, 4, 64


class Network(nn.Module):
    """A policy and a value over a shared encoding of observations."""

    def __init__(self, space: spaces.Space[Any], n_actions: int) -> None:
        super().__init__()
        self.space = space
        self.policy = self._layers(n_actions, 0.01)
        self.value = self._layers(1, 1.0)

    def _layers(self, n_out: int, gain: float) -> nn.Sequential:
        last = nn.Linear(32, n_out)
        nn.init.orthogonal_(last.weight, gain)
        return nn.Sequential(nn.Linear(spaces.flatdim(self.space), 32), nn.Tanh(), last)

    def encode(self, observation: Any) -> Tensor:
        if isinstance(self.space, spaces.Discrete):
            return nn.functional.one_hot(
                torch.as_tensor(observation), int(self.space.n)
            ).float()
        return torch.as_tensor(observation, dtype=torch.float32)


@dataclass
class Record:
    """What a run has seen."""

    losses: list[float] = field(default_factory=list)
    first_ratios: list[float] = field(default_factory=list)
    reported: list[tuple[float, int]] = field(default_factory=list)
    summed: list[tuple[float, int]] = field(default_factory=list)
    shapes: set[tuple[Any, ...]] = field(default_factory=set)


def advantages(
    rewards: Tensor, values: Tensor, terminated: Tensor, done: Tensor
) -> Tensor:
    """Of `n` steps, `(n, slots)`; `values` has a row more."""
    result = torch.zeros_like(rewards)
    ahead = torch.zeros(rewards.shape[1])
    for t in reversed(range(len(rewards))):
        error = rewards[t] + DISCOUNT * values[t + 1] * ~terminated[t] - values[t]
        ahead = error + DISCOUNT * TRACE * ahead * ~done[t]
        result[t] = ahead
    return result


def train(env: Any, updates: int, seed: int) -> Record:
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    record, slots = Record(), env.num_envs
    network = Network(env.single_observation_space, int(env.single_action_space.n))
    optimizer = torch.optim.Adam(network.parameters(), lr=0.01, eps=1e-5)
    observation, _ = env.reset(seed=seed)
    resetting = np.zeros(slots, dtype=np.bool_)
    returns, lengths = np.zeros(slots), np.zeros(slots, dtype=int)
    for _ in range(updates):
        rows: list[tuple[Tensor, ...]] = []
        for _ in range(N_STEPS):
            seen = network.encode(observation)
            with torch.no_grad():
                choice = Categorical(logits=network.policy(seen))
                actions = choice.sample()
            observation, rewards, terminated, truncated, infos = env.step(
                actions.numpy()
            )
            record.shapes.add(
                (
                    np.shape(observation),
                    rewards.shape,
                    terminated.shape,
                    truncated.shape,
                )
            )
            done = terminated | truncated
            returns += np.where(resetting, 0, rewards)
            lengths += ~resetting
            for slot in np.flatnonzero(done):
                record.summed.append((float(returns[slot]), int(lengths[slot])))
                assert infos["_episode"][slot]
                stats = infos["episode"]
                record.reported.append((float(stats["r"][slot]), int(stats["l"][slot])))
                returns[slot] = lengths[slot] = 0
            assert done.any() or "episode" not in infos
            rows.append(
                (
                    seen,
                    actions,
                    choice.log_prob(actions),
                    torch.as_tensor(rewards, dtype=torch.float32),
                    torch.as_tensor(terminated),
                    torch.as_tensor(done),
                    torch.as_tensor(~resetting),
                )
            )
            resetting = done
        states, actions, log_probs, rewards, terminated, done, used = (
            torch.stack(column) for column in zip(*rows, strict=True)
        )
        with torch.no_grad():
            values = network.value(
                torch.cat([states, network.encode(observation)[None]])
            ).squeeze(-1)
        advantage = advantages(rewards, values, terminated, done)
        target = advantage + values[:-1]
        data = [x[used] for x in (states, actions, log_probs, advantage, target)]
        for epoch in range(EPOCHS):
            order = rng.permutation(len(data[0]))
            for begin in range(0, len(order), BATCH):
                batch = torch.as_tensor(order[begin : begin + BATCH])
                s, a, old, adv, goal = (x[batch] for x in data)
                policy = Categorical(logits=network.policy(s))
                ratio = (policy.log_prob(a) - old).exp()
                if epoch == begin == 0:
                    record.first_ratios.append(float((ratio - 1).abs().max().detach()))
                adv = (adv - adv.mean()) / (adv.std() + 1e-8)
                gain = torch.minimum(ratio * adv, ratio.clamp(1 - CLIP, 1 + CLIP) * adv)
                error = (network.value(s).squeeze(-1) - goal).square().mean()
                loss = -gain.mean() + 0.5 * error - 0.01 * policy.entropy().mean()
                optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(network.parameters(), 0.5)
                optimizer.step()
                record.losses.append(float(loss.detach()))
    return record


@pytest.mark.parametrize("how", [None, "sync"], ids=["native", "sync"])
@pytest.mark.parametrize(
    ("env_id", "shape"),
    [
        ("acl_gym:acl_gym/Pendulum-v0", (8, 2)),
        ("acl_gym:acl_gym/GridSearch1D-v0", (8,)),
    ],
)
def test_ppo_as_people_write_it(
    env_id: str, shape: tuple[int, ...], how: str | None
) -> None:
    env = RecordEpisodeStatistics(
        gym.make_vec(env_id, num_envs=8, vectorization_mode=how, max_episode_steps=20)
    )
    record = train(env, updates=12, seed=0)
    env.close()
    assert record.shapes == {(shape, (8,), (8,), (8,))}
    assert np.isfinite(record.losses).all()
    # Before the first update the policy is the one that chose the actions.
    assert max(record.first_ratios) < 1e-5
    # 12 x 32 steps of 8 slots, of which episodes of at most 20 steps and a reset.
    assert len(record.reported) >= 12 * 32 * 8 // 21 - 8
    reported, summed = np.array(record.reported), np.array(record.summed)
    np.testing.assert_allclose(reported[:, 0], summed[:, 0], rtol=1e-5)
    np.testing.assert_array_equal(reported[:, 1], summed[:, 1])
    assert reported[:, 1].max() <= 20
    if "Grid" in env_id:  # a walk to the goal takes 1 to 9 steps, a random one many
        first, last = summed[:40, 1].mean(), summed[-40:, 1].mean()
        assert last < 0.6 * first
