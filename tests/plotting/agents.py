"""Small agents to draw."""

from __future__ import annotations

from typing import Any

import gymnasium as gym

from acl_gym import ACL, Crisp, Fuzzy, QLearning


def colony(env_id: str, trials: int = 2, **options: Any) -> ACL:
    env = gym.make_vec(env_id, num_envs=5)
    return ACL(env, seed=0, max_steps=20, **options).learn(trials=trials)


def pendulum(trials: int = 2, kind: type[Crisp | Fuzzy] = Fuzzy) -> ACL:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5)
    grid = kind.from_box(env.single_observation_space, (8, 9), circular=[0])
    agent = ACL(env, grid, seed=0, max_steps=20)
    return agent.learn(trials=trials) if trials else agent


def q_learning(env_id: str, trials: int = 2, slots: int = 4) -> QLearning:
    env = gym.make_vec(env_id, num_envs=slots)
    return QLearning(env, seed=0, max_steps=20).learn(trials=trials)
