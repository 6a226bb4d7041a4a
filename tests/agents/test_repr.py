"""What agents say they are, in a line and in a notebook."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import ACL, Crisp, Fuzzy, QLearning
from acl_gym.colony.schedules import Linear


def pendulum(trials: int = 1, **options: Any) -> ACL:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5)
    grid = Fuzzy.from_box(env.single_observation_space, (8, 9), circular=[0])
    agent = ACL(env, grid, seed=0, max_steps=20, **options)
    return agent.learn(trials=trials) if trials else agent


class Parser(HTMLParser):
    """Collects tags and what stands between them."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.open: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.tags.append(tag)
        if tag not in ("img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def parsed(page: str) -> Parser:
    parser = Parser()
    parser.feed(page)
    parser.close()
    assert parser.open == []
    return parser


def test_a_line() -> None:
    agent = pendulum()
    steps = agent.num_timesteps
    assert repr(agent) == (
        "ACL(Pendulum-v0, 5 ants, Fuzzy(8 x 9 cells, circular=[0]), 1 trial, "
        f"{steps} steps)"
    )
    q = QLearning(gym.make_vec("MountainCar-v0", num_envs=2), seed=0)
    assert repr(q).startswith("QLearning(MountainCar-v0, 2 slots, Fuzzy(")
    assert len(repr(q)) < 100


def test_an_agent_without_an_environment_or_not_complete() -> None:
    agent = ACL(None, Crisp([[0.0, 1.0]]), n_actions=2)
    assert repr(agent) == "ACL(Crisp(2 cells, circular=[]), 0 trials, 0 steps)"
    assert "picture" not in repr(ACL.__new__(ACL))
    assert repr(ACL.__new__(ACL)) == "ACL(not complete)"


def test_policies() -> None:
    agent = pendulum()
    partition = "Fuzzy(8 x 9 cells, circular=[0])"
    assert repr(agent.policy) == f"TablePolicy({partition}, 3 actions)"
    assert repr(agent.soft_policy()) == f"SoftPolicy({partition}, 3 actions)"


def test_a_notebook_shows_parameters_and_a_picture() -> None:
    page = pendulum(epsilon=Linear(0.3, 0.1, trials=5))._repr_html_()
    parser = parsed(page)
    for text in ("tau0", "τ", "local_decay", "γ", "Pendulum-v0, 5 ants", " +0.8 N m"):
        assert text in parser.text
    assert "Linear(start=0.3, end=0.1, trials=5)" in parser.text
    assert parser.tags.count("img") == 1
    assert re.search(r'src="data:image/png;base64,[A-Za-z0-9+/=]+"', page)
    assert len(page) < 20_000


def test_what_is_shown_is_escaped() -> None:
    kind = type("<script>alert(1)</script>", (QLearning,), {})
    agent = kind(None, Crisp([[0.0, 1.0]]), n_actions=2)
    parser = parsed(agent._repr_html_())
    assert "script" not in parser.tags
    assert "<script>alert(1)</script>" in parser.text


def test_a_notebook_never_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken(QLearning):
        @property
        def n_actions(self) -> int:
            raise RuntimeError("broken")

    agent = QLearning(None, Crisp([[0.0, 1.0]]), n_actions=2)
    agent.__class__ = Broken
    assert parsed(agent._repr_html_()).tags.count("img") == 0
    assert parsed(ACL.__new__(ACL)._repr_html_()).text == ["ACL(not complete)"]


@pytest.mark.parametrize("sizes", [(3,), (3, 1), (2, 3, 4), (1, 1, 5), (1,)])
def test_a_picture_of_any_number_of_variables(sizes: tuple[int, ...]) -> None:
    partition = Crisp([np.arange(float(size)) for size in sizes])
    agent = ACL(None, partition, n_actions=12, seed=0)
    parser = parsed(agent._repr_html_())
    assert parser.tags.count("img") == 1
    assert any("others in the middle" in text for text in parser.text) == (
        len(sizes) > 2
    )


def test_a_partition_of_another_kind_has_no_picture() -> None:
    agent = ACL(None, Crisp([np.arange(500.0)]), n_actions=2, seed=0)
    assert parsed(agent._repr_html_()).tags.count("img") == 0  # too large
