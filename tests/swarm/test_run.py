"""Running a swarm: the order of its parts, what is recorded, how it ends."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acl_gym.swarm import (
    Channel,
    ConsensusAgents,
    Delayed,
    DynamicAgents,
    Environment,
    Everyone,
    Inbox,
    Links,
    Lossy,
    Radius,
    Ring,
    run,
)


class Plane(Environment):
    """Points that move by their inputs, disturbed."""

    def __init__(self, n: int = 6, noise: float = 0.0, lasts: float = math.inf) -> None:
        self._n, self._noise, self._lasts = n, noise, lasts

    def reset(self, rng: np.random.Generator) -> None:
        self.x = rng.normal(size=(self._n, 2))
        self.time = 0

    @property
    def done(self) -> bool:
        return self.time >= self._lasts

    def observe(self) -> Any:
        return self.x.copy()

    def step(self, u: Any, rng: np.random.Generator) -> None:
        self.x = self.x + u + self._noise * rng.normal(size=self.x.shape)
        self.time += 1


class Jittery(ConsensusAgents):
    """Agents that draw random numbers to decide."""

    def decide(self, rng: np.random.Generator) -> Any:
        return super().decide(rng) + 0.1 * rng.normal(size=self.positions.shape)


def averaged(x: np.ndarray, heard_x: np.ndarray, k: int) -> np.ndarray:
    """A step of averaging on a ring of k neighbours to each side, agent by agent."""
    n, moved = len(x), np.empty_like(x)
    for i in range(n):
        mean = sum(heard_x[(i + s) % n] for s in range(-k, k + 1)) / (2 * k + 1)
        moved[i] = x[i] + 0.5 * (mean - x[i])
    return moved


@pytest.mark.parametrize("stale", [False, True])
@pytest.mark.parametrize("k", [1, 2])
def test_a_run_is_the_loop_over_agents(k: int, stale: bool) -> None:
    history = run(ConsensusAgents(), Plane(), 8, 3, Ring(k), stale=stale, record=("x",))
    x = history["x"]
    assert x.shape == (9, 6, 2)
    np.testing.assert_array_equal(x[0], np.random.default_rng(3).normal(size=(6, 2)))
    for t in range(8):
        heard = x[max(t - 1, 0)] if stale else x[t]
        np.testing.assert_allclose(x[t + 1], averaged(x[t], heard, k), atol=1e-14)


def test_a_delay_of_one_step_is_what_stale_means_here() -> None:
    """Messages hold observations only, and neighbourhoods do not depend on positions."""
    stale = run(ConsensusAgents(), Plane(), 8, 3, Ring(), stale=True, record=("x",))
    late = run(ConsensusAgents(), Plane(), 8, 3, Delayed(Ring(), 1), record=("x",))
    np.testing.assert_array_equal(stale["x"], late["x"])


class Journal(DynamicAgents):
    """Agents that write down what is called, and send how often they have observed."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.heard: list[float] = []

    def reset(self, n: int, rng: np.random.Generator) -> None:
        self.calls.append("reset")
        self.seen = np.zeros(n)

    def observe(self, y: Any) -> None:
        self.calls.append("observe")
        self.seen += 1  # in place: what was sent must not change with it

    def send(self) -> dict[str, Any]:
        self.calls.append("send")
        return {"seen": self.seen}

    def hear(self, inbox: Inbox) -> None:
        self.calls.append("hear")
        self.heard.append(float(inbox.messages["seen"][0]))

    def decide(self, rng: np.random.Generator) -> Any:
        self.calls.append("decide")
        return np.zeros((len(self.seen), 2))


def test_agents_observe_send_hear_and_decide() -> None:
    agents = Journal()
    run(agents, Plane(), 2, 0)
    assert agents.calls == ["reset", *["observe", "send", "hear", "decide"] * 2]
    assert agents.heard == [1, 2]


def test_strictly_agents_send_before_they_observe() -> None:
    agents = Journal()
    run(agents, Plane(), 4, 0, stale=True)
    step = ["send", "observe", "hear", "decide"]
    assert agents.calls == ["reset", "observe", "send", *step[2:], *step * 3]
    assert agents.heard == [1, 1, 2, 3]


@pytest.mark.parametrize("stale", [False, True])
def test_the_same_seed_gives_the_same_bits(stale: bool) -> None:
    def x(rng: Any) -> np.ndarray:
        channel = Delayed(Lossy(Radius(1.5), 0.3), 2)
        agents, plane = Jittery(), Plane(40, noise=0.1)
        return run(agents, plane, 20, rng, channel, stale=stale, record=("x",))["x"]

    assert x(7).tobytes() == x(7).tobytes() == x(np.random.default_rng(7)).tobytes()
    assert x(7).tobytes() != x(8).tobytes()
    assert not np.array_equal(x(None), x(None))


def test_parts_are_reset_before_each_run() -> None:
    agents, plane, channel = ConsensusAgents(), Plane(), Delayed(Everyone(), 3)
    first = run(agents, plane, 5, 1, channel, record=("x",))
    again = run(agents, plane, 5, 1, channel, record=("x",))
    np.testing.assert_array_equal(first["x"], again["x"])


def test_symmetric_links_keep_the_centre() -> None:
    def drift(channel: Channel) -> float:
        x = run(ConsensusAgents(), Plane(60), 50, 0, channel, record=("x",))["x"]
        return float(np.abs(x[-1].mean(axis=0) - x[0].mean(axis=0)).max())

    for channel in (Everyone(), Ring(2), Lossy(Everyone(), 0.0)):
        assert drift(channel) < 1e-14
    assert drift(Lossy(Ring(2), 0.3)) > 1e-3


def test_each_agent_may_have_parameters_of_its_own() -> None:
    """Definition 6.8; those with gain 0 stand still, and the others come to them."""
    gain = np.array([0.0, 0.5, 1.0])
    x = run(ConsensusAgents(gain), Plane(3), 200, 0, record=("x",))["x"]
    np.testing.assert_array_equal(x[-1, 0], x[0, 0])
    np.testing.assert_allclose(x[-1], np.tile(x[0, 0], (3, 1)), atol=1e-12)


def test_the_environment_ends_the_run() -> None:
    history = run(ConsensusAgents(), Plane(lasts=4), 10, 0, record=("x", "time"))
    assert (history.steps, history.done) == (4, True)
    assert history["time"].tolist() == [0, 1, 2, 3, 4]
    at_once = run(ConsensusAgents(), Plane(lasts=0), 10, 0, record=["x"])
    assert (at_once.steps, at_once.done) == (0, True)
    assert at_once["x"].shape == (1, 6, 2)


@pytest.mark.parametrize("no", [False, np.False_])
def test_a_callback_sees_each_step_and_may_end_the_run(no: Any) -> None:
    seen = []

    def callback(step: int, agents: ConsensusAgents, plane: Plane) -> Any:
        seen.append((step, plane.time, np.array_equal(agents.positions, plane.x)))
        return no if step == 3 else None

    history = run(ConsensusAgents(), Plane(), 10, 0, callback=callback)
    assert (history.steps, history.done) == (3, False)
    assert seen == [(1, 1, False), (2, 2, False), (3, 3, False)]


def test_nothing_is_recorded_unless_asked_for() -> None:
    history = run(ConsensusAgents(), Plane(), 0, 0)
    assert (history.steps, history.done, history.recorded) == (0, False, {})


class Passing(Channel):
    """Delivers what it is told, whatever it is sent."""

    def __init__(self, delivered: Any) -> None:
        self.delivered = delivered

    def deliver(self, sent: Any, x: Any, rng: Any) -> Any:
        return self.delivered(sent)


@pytest.mark.parametrize("wrapper", [None, lambda each: Lossy(each, 0.0)])
@pytest.mark.parametrize(
    ("delivered", "error", "words"),
    [
        (
            lambda sent: None,
            TypeError,
            "Passing.deliver must return an Inbox, got None",
        ),
        (lambda sent: sent, TypeError, "return Inbox"),
        (
            lambda sent: Inbox(Links.everyone(3_000_000), {}),
            ValueError,
            r"links of the 6 agents .* got links of 3000000",
        ),
    ],
)
def test_what_a_channel_delivers_is_checked(delivered, error, words, wrapper) -> None:
    channel = Passing(delivered)
    with pytest.raises(error, match=words):
        run(ConsensusAgents(), Plane(), 2, 0, wrapper(channel) if wrapper else channel)


def test_what_cannot_be_recorded_is_refused() -> None:
    class Growing(Plane):
        @property
        def trail(self) -> list[float]:
            return [1.0] * (self.time + 1)

    for name, words in (
        ("observe", r"arrays or numbers, .* got 'observe', which is <bound method"),
        ("trail", r"keep their shape, got 'trail', whose shape was \(1,\) and is now"),
    ):
        with pytest.raises(ValueError, match=words):
            run(ConsensusAgents(), Growing(), 3, 0, record=(name,))


def test_states_are_there_after_the_first_reset() -> None:
    class Late(Plane):
        pass

    for name in ("x", "n", "positions"):
        with pytest.raises(AttributeError, match=r"attribute 'x'; .*first reset"):
            getattr(Late(), name)
    with pytest.raises(AttributeError, match=r"attribute 'speed'$"):
        Late().speed  # noqa: B018


class Vehicles(Plane):
    """Positions in the first of two columns, far-away speeds in the second."""

    def reset(self, rng: np.random.Generator) -> None:
        self.x = np.array([[0.0, 0.0], [0.1, 50.0], [5.0, 0.0]])
        self.time = 0

    @property
    def positions(self) -> np.ndarray:
        return self.x[:, :1]


def test_channels_go_by_positions_not_by_states() -> None:
    counts = []

    class Counting(ConsensusAgents):
        def hear(self, inbox: Inbox) -> None:
            super().hear(inbox)
            counts.append(inbox.count.tolist())

    run(Counting(0.0), Vehicles(), 1, 0, Radius(1.0))
    assert counts == [[2, 2, 1]]


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("channel", [None, Ring(), Radius(1.0)])
def test_positions_that_diverge_end_in_one_clear_error(bad, channel) -> None:
    class Broken(Plane):
        def step(self, u: Any, rng: np.random.Generator) -> None:
            super().step(u, rng)
            self.x[4, 1] = bad if self.time == 2 else self.x[4, 1]

    with pytest.raises(ValueError, match=r"positions must be numbers .* for agent 4"):
        run(ConsensusAgents(), Broken(), 5, 0, channel)


def test_the_number_of_agents_must_not_change() -> None:
    class Shrinking(Plane):
        def step(self, u: Any, rng: np.random.Generator) -> None:
            self.x = self.x[1:]

    with pytest.raises(ValueError, match=r"positions must be .* shape \(6, dim\)"):
        run(ConsensusAgents(), Shrinking(), 5, 0)


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        (
            {"agents": ConsensusAgents},
            TypeError,
            "subclass of DynamicAgents, got <class",
        ),
        ({"environment": None}, TypeError, "subclass of Environment, got None"),
        ({"channel": Ring}, TypeError, "subclass of Channel, got <class"),
        ({"steps": -1}, ValueError, "steps must be at least 0, got -1"),
        ({"steps": 1.5}, TypeError, "steps must be an integer"),
        ({"rng": "seed"}, TypeError, "rng must be an integer"),
        ({"record": "x"}, TypeError, 'a collection of names, such as ("x",), got'),
        ({"record": ("velocity",)}, ValueError, "attributes of Plane.* got 'velocity'"),
        ({"stale": 1}, TypeError, "stale must be True or False"),
        ({"callback": 3}, TypeError, "callback must be a function"),
    ],
)
def test_arguments_of_the_wrong_kind_are_refused(changes, error, words) -> None:
    arguments = {
        "agents": ConsensusAgents(),
        "environment": Plane(),
        "steps": 1,
    } | changes
    with pytest.raises(error, match=words.replace("(", r"\(").replace(")", r"\)")):
        run(**arguments)


WITHOUT_GYMNASIUM = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "gymnasium":
            raise ModuleNotFoundError("No module named 'gymnasium'", name="gymnasium")

sys.meta_path.insert(0, Absent())
import acl_gym
import acl_gym.theory
from acl_gym import swarm
assert acl_gym.swarm is swarm
assert all(hasattr(swarm, name) for name in swarm.__all__)
assert "gymnasium" not in sys.modules
try:
    acl_gym.ACL
except ModuleNotFoundError as error:
    assert error.name == "gymnasium"
else:
    raise AssertionError("ACL came without Gymnasium")
"""


def test_swarms_and_theory_need_no_gymnasium(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", WITHOUT_GYMNASIUM],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr


class Bodiless(Plane):
    """Its states are no array."""

    def __init__(self, x: Any) -> None:
        self._x = x

    def reset(self, rng: np.random.Generator) -> None:
        if self._x != "unset":
            self.x = self._x


@pytest.mark.parametrize("x", [None, 3.0, [[1.0], [2.0, 3.0]]])
def test_states_that_are_no_rows(x: Any) -> None:
    with pytest.raises(
        ValueError, match=r"x must be an array with a row .* reset of Bodiless"
    ):
        run(ConsensusAgents(), Bodiless(x), 1, 0)


def test_a_reset_that_sets_no_states() -> None:
    with pytest.raises(AttributeError, match="the first reset, which must set x"):
        run(ConsensusAgents(), Bodiless("unset"), 1, 0)


class Mistyped(Plane):
    """A property that fails for a reason of its own."""

    @property
    def positions(self) -> Any:
        return self.postions  # (sic)


def test_a_property_that_fails_says_why() -> None:
    with pytest.raises(AttributeError, match="no attribute 'postions'") as caught:
        run(ConsensusAgents(), Mistyped(), 1, 0)
    assert "reset" not in str(caught.value)


def test_what_was_not_recorded() -> None:
    history = run(ConsensusAgents(), Plane(), 1, 0, record=("time",))
    with pytest.raises(KeyError, match=r"'x' must be among .* \['time'\]; pass record"):
        history["x"]


class Mute(ConsensusAgents):
    """Agents whose messages are none."""

    def send(self) -> Any:
        return None


@pytest.mark.parametrize("stale", [False, True])
@pytest.mark.parametrize("channel", [Everyone(), Delayed(Everyone(), 1)])
def test_messages_that_are_none(channel: Channel, stale: bool) -> None:
    with pytest.raises(TypeError, match="messages must be a dict of arrays"):
        run(Mute(), Plane(), 2, 0, channel, stale=stale)


@pytest.mark.parametrize("moved", [False, True])
def test_channels_are_given_positions_that_have_been_checked(moved: bool) -> None:
    seen = []

    class Listed(Plane):
        @property
        def positions(self) -> Any:
            return self.x.tolist()

    class Seen(Everyone):
        def links(self, x: Any) -> Links:
            seen.append(x)
            return super().links(x)

    def move(steps: int, agents: Any, environment: Any) -> None:
        environment.x = environment.x + 1.0

    environment = Listed()
    history = run(
        ConsensusAgents(),
        environment,
        3,
        0,
        Seen(),
        record=("x",),
        callback=move if moved else None,
    )
    assert all(isinstance(x, np.ndarray) for x in seen)
    wanted = history["x"][:3] + np.reshape([0, moved, moved], (3, 1, 1))
    np.testing.assert_array_equal(seen, wanted)
