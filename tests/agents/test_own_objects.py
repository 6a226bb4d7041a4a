"""A user's own objects are saved by name, and given again when the agent is loaded."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acl_gym import ACL, Crisp, Discrete, Fuzzy, Partition, QLearning
from acl_gym.agents.base import TabularAgent
from acl_gym.costs import Cost, Quadratic, SettlingTime, Steps, Sum
from acl_gym.deposits import Deposit, Rank
from acl_gym.partitions.settings import MissingPartition
from acl_gym.schedules import Linear, Schedule
from acl_gym.utils.serialization import Unsaved, own_name
from tests.agents.reference_colony import chains

ROW = Crisp([np.arange(6.0)])
STATES = np.arange(5.0)[:, None]


@dataclass(frozen=True)
class Tracking(Cost):
    """A cost of a user's own, with a list and an object that no file could hold."""

    factor: float = 1.0
    table: Any = ()
    helper: object = object()

    def __call__(self, episodes: Any) -> Any:
        return self.factor * episodes.lengths.astype(float)


class Twice(Steps):
    def __call__(self, episodes: Any) -> Any:
        return 2.0 * super().__call__(episodes)


class OwnRank(Rank):
    pass


class Flat(Deposit):
    def __call__(self, costs: Any, tau0: float) -> Any:
        return np.full(costs.size, 1.0)


class Falling(Schedule):
    def __call__(self, trial: int) -> float:
        return 1.0 / (1 + trial)


class Callable3:
    def __call__(self, trial: int) -> float:
        return 0.3


@dataclass(frozen=True)
class Steep(Linear):
    more: float = 1.0


def one_third(trial: int) -> float:
    return 1 / 3


def length(episode: Any) -> float:
    return float(len(episode.actions))


# What is given, and the parameter that is missing afterwards.
OWN: dict[str, tuple[str, Callable[[], Any]]] = {
    "own cost": ("cost", Tracking),
    "own cost in a sum": ("cost", lambda: 2.0 * Tracking(3.0) + Steps() + 1.0),
    "subclass of a cost": ("cost", Twice),
    "function of a solution": ("cost", lambda: length),
    "lambda of a solution": ("cost", lambda: lambda episode: 1.0),
    "own deposit": ("deposit", Flat),
    "subclass of a deposit": ("deposit", OwnRank),
    "function of the costs": ("deposit", lambda: lambda costs: np.exp(-costs)),
    "method": ("deposit", lambda: np.exp),
    "own schedule": ("epsilon", Falling),
    "subclass of a schedule": ("epsilon", lambda: Steep(0.5, 0.1, 3)),
    "function of the trial": ("epsilon", lambda: one_third),
    "callable object": ("epsilon", Callable3),
    "function for alpha": ("alpha", lambda: lambda trial: 2.0 + trial),
    "function for beta": ("beta", Falling),
}


def colony(**more: Any) -> ACL:
    return ACL(chains(4, slip=0.2), ROW, tau0=1e-3, max_steps=9, seed=0, **more)


@pytest.mark.parametrize("name", OWN)
def test_what_cannot_be_saved_is_given_again(name: str, tmp_path: Path) -> None:
    parameter, make = OWN[name]
    agent = colony(**{parameter: make()}).learn(trials=2)
    path = agent.save(tmp_path / "agent")

    loaded = ACL.load(path, chains(4, slip=0.2))
    assert loaded.table.tobytes() == agent.table.tobytes()
    np.testing.assert_array_equal(loaded.predict(STATES)[0], agent.predict(STATES)[0])
    remedy = (
        rf"{parameter} was '.*', which .*set agent\.{parameter} to it, or pass load"
    )
    with pytest.raises(ValueError, match=remedy):
        loaded.learn(trials=1)
    assert loaded.trials == 2
    # A file of a file says the same.
    again = ACL.load(loaded.save(tmp_path / "again"), chains(4, slip=0.2))
    assert again.parameters() == loaded.parameters() == agent.parameters()

    setattr(again, parameter, make())
    at_once = ACL.load(path, chains(4, slip=0.2), **{parameter: make()})
    for other in (again, at_once):
        other.learn(trials=2)
    agent.learn(trials=2)
    assert again.table.tobytes() == agent.table.tobytes()
    assert at_once.table.tobytes() == agent.table.tobytes()


def test_what_is_missing_shows_its_name(tmp_path: Path) -> None:
    loaded = ACL.load(colony(epsilon=one_third).save(tmp_path / "agent"))
    name = own_name(one_third)
    assert repr(loaded.epsilon) == f"<{name}, which is not in the file>"
    assert name in loaded._repr_html_()


def test_a_name_says_where_it_is_from() -> None:
    assert own_name(length).endswith("test_own_objects:length")
    assert own_name(Falling()) == own_name(Falling)
    assert Unsaved("cost", own_name(length)).name in str(
        Unsaved("cost", own_name(length)).error()
    )


def test_a_name_in_a_file_is_never_looked_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A module that the file names is not imported, though it is there."""
    (tmp_path / "trap.py").write_text("raise SystemExit('imported')")
    monkeypatch.syspath_prepend(tmp_path)
    agent = colony(cost=type("X", (Twice,), {"__module__": "trap"})())
    loaded = ACL.load(agent.save(tmp_path / "agent"))
    assert loaded.parameters()["cost"] == {"type": "function", "name": "trap:X"}
    with pytest.raises(ValueError, match="cost was 'trap:X'"):
        loaded.require_all_given()


class Shifted(Crisp):
    def locate(self, states: Any, slots: Any, index: Any, degree: Any) -> None:
        super().locate(states, slots, index, degree)


class OwnDiscrete(Discrete):
    pass


class OwnFuzzy(Fuzzy):
    pass


class Halves(Partition):
    n_cells, cells_per_state = 2, 1

    def __init__(self, edge: Any = 2.5) -> None:
        self.edge = edge

    def locate(self, states: Any, slots: Any, index: Any, degree: Any) -> None:
        index[: slots.size, 0] = states[slots, 0] > float(self.edge)
        degree[: slots.size] = 1.0

    def settings(self) -> dict[str, Any]:
        return {"edge": self.edge}

    def cell_states(self) -> Any:
        return np.array([[1.0], [4.0]])


PARTITIONS: dict[str, Callable[[], Partition]] = {
    "crisp": lambda: Shifted([np.arange(6.0)]),
    "fuzzy": lambda: OwnFuzzy([np.arange(3.0) * 2.0]),
    "own": Halves,
    "settings with an array": lambda: Halves(np.array(2.5)),
    "settings that are no JSON": lambda: Halves(Fraction()),
}


class Fraction:
    def __float__(self) -> float:
        return 2.5


@pytest.mark.parametrize("kind", [ACL, QLearning])
@pytest.mark.parametrize("name", PARTITIONS)
def test_partitions_of_ones_own(
    kind: type[TabularAgent], name: str, tmp_path: Path
) -> None:
    make = PARTITIONS[name]
    agent: Any = kind(chains(4), make(), max_steps=9, seed=0).learn(trials=2)
    path = agent.save(tmp_path / "agent")
    loaded: Any = kind.load(path, chains(4))
    assert isinstance(loaded.partition, MissingPartition)
    assert loaded.table.tobytes() == agent.table.tobytes()
    for use in (lambda: loaded.predict(STATES), lambda: loaded.learn(trials=1)):
        with pytest.raises(ValueError, match=r"load\(path, env, partition=\.\.\.\)"):
            use()
    again = kind.load(loaded.save(tmp_path / "again"), chains(4), partition=make())
    again.learn(trials=2)
    agent.learn(trials=2)
    assert again.table.tobytes() == agent.table.tobytes()


def test_another_partition_is_refused(tmp_path: Path) -> None:
    path = ACL(chains(4), Halves(), max_steps=9, seed=0).save(tmp_path / "agent")
    with pytest.raises(ValueError, match="must have 2 cells as the table has, got 6"):
        ACL.load(path, partition=ROW)
    with pytest.raises(ValueError, match=r"that the agent was saved with, got .*3\.5"):
        ACL.load(path, partition=Halves(3.5))
    with pytest.raises(TypeError, match="partition must be a Partition"):
        ACL.load(path, partition="Halves")


class Bonus(ACL):
    """A subclass whose constructor has more arguments than a file holds."""

    def __init__(self, env: Any, partition: Any = None, *, bonus: Any = 1, **more: Any):
        super().__init__(env, partition, **more)
        self.bonus = bonus


class Kept(Bonus):
    def parameters(self) -> dict[str, Any]:
        return {**super().parameters(), "bonus": self.bonus}


def test_a_subclass_gets_the_arguments_that_its_file_lacks(tmp_path: Path) -> None:
    agent = Bonus(chains(4), ROW, bonus=7, seed=0, max_steps=9).learn(trials=1)
    path = agent.save(tmp_path / "agent")
    with pytest.raises(
        ValueError, match=r"needs bonus, .*Bonus\.load\(path, env, bonus"
    ):
        Bonus.load(path)
    loaded = Bonus.load(path, bonus=7)
    assert loaded.bonus == 7
    assert loaded.table.tobytes() == agent.table.tobytes()
    with pytest.raises(
        ValueError, match="must hold an agent of class ACL, got 'Bonus'"
    ):
        ACL.load(path)


class Closed(ACL):
    """A subclass that `load` could not make: it takes neither partition nor number."""

    def __init__(self, env: Any) -> None:
        super().__init__(env, ROW, seed=0, max_steps=9)


def test_a_subclass_that_cannot_be_made_again_is_not_written(tmp_path: Path) -> None:
    agent = Closed(chains(4)).learn(trials=1)
    with pytest.raises(TypeError, match=r"Closed must be made by .*\*\*keywords"):
        agent.save(tmp_path / "agent")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("bonus", [7, 1.5, (1, "a"), np.arange(3.0), None])
def test_a_subclass_may_have_its_arguments_in_the_file(
    bonus: Any, tmp_path: Path
) -> None:
    agent = Kept(chains(4), ROW, bonus=bonus, seed=0, max_steps=9)
    loaded = Kept.load(agent.save(tmp_path / "agent"))
    np.testing.assert_array_equal(loaded.bonus, bonus)
    assert type(loaded.bonus) is type(bonus)


def test_an_object_among_them_goes_by_its_name(tmp_path: Path) -> None:
    agent = Kept(chains(4), ROW, bonus=Fraction(), seed=0, max_steps=9)
    path = agent.save(tmp_path / "agent")
    with pytest.raises(ValueError, match="needs bonus"):
        Kept.load(path)
    assert isinstance(Kept.load(path, bonus=Fraction()).bonus, Fraction)


def test_arguments_given_to_load_replace_those_in_the_file(tmp_path: Path) -> None:
    path = colony(alpha=2.0).save(tmp_path / "agent")
    assert ACL.load(path, alpha=5.0, epsilon=Linear(0.5, 0.1, 9)).alpha == 5.0
    with pytest.raises(TypeError, match=r"takes the arguments of ACL.*got alpa"):
        ACL.load(path, alpa=5.0)
    with pytest.raises(TypeError, match="got seed"):
        ACL.load(path, seed=1)
    # What is wrong with them is not blamed on the file.
    with pytest.raises(ValueError, match=r"^alpha must lie in"):
        ACL.load(path, alpha=-1.0)


def test_settings_of_numpy_are_settings_of_python() -> None:
    cost = Quadratic(np.array([3, 0]), np.eye(2), np.array([[-1.0], [1]]), np.ones(1))
    assert cost == Quadratic((3, 0), ((1, 0), (0, 1)), ((-1.0,), (1.0,)), (1.0,))
    assert hash(cost) == hash(eval(repr(cost), {"Quadratic": Quadratic}))
    time = SettlingTime(np.int64(0), np.float32(3.14), np.float64(0.1))
    assert [type(value) for value in (time.variable, time.target)] == [int, float]
    assert time.target == np.float32(3.14)  # exactly
    with pytest.raises(TypeError, match="terms must be made of Costs"):
        Sum((Steps(), length))  # type: ignore[arg-type]


def test_a_sum_of_many_costs_is_saved(tmp_path: Path) -> None:
    """As `sum` makes it, term by term."""
    agent = colony(cost=sum([Steps()] * 400, start=Steps())).learn(trials=1)
    loaded = ACL.load(agent.save(tmp_path / "agent"), chains(4, slip=0.2))
    assert loaded.cost == agent.cost
    assert (
        loaded.learn(trials=1).table.tobytes() == agent.learn(trials=1).table.tobytes()
    )


def test_what_cannot_be_saved_at_all_is_refused_before_learning() -> None:
    cost = Steps()
    for _ in range(500):
        cost = 1.001 * cost
    agent = colony(cost=cost)
    with pytest.raises(TypeError, match=r"cost must lie at most .* deep"):
        agent.learn(trials=1)
    assert agent.trials == 0


@pytest.mark.parametrize("kind", [ACL, QLearning])
def test_files_that_are_open(kind: type[TabularAgent], tmp_path: Path) -> None:
    agent: Any = kind(chains(4), ROW, max_steps=9, seed=0).learn(trials=2)
    memory = io.BytesIO()
    assert agent.save(memory) is None
    memory.seek(0)
    path = tmp_path / "agent.bin"
    with path.open("wb") as file:
        agent.save(file)
    with path.open("rb") as file:
        loaded: list[Any] = [kind.load(memory), kind.load(file, chains(4))]
    for each in loaded:
        assert each.table.tobytes() == agent.table.tobytes()
    with pytest.raises(TypeError, match="binary mode"):
        agent.save(io.StringIO())
    with (
        path.open(encoding="latin-1") as text,
        pytest.raises(TypeError, match="binary"),
    ):
        kind.load(text)
    for wrong in (None, 3, b"agent"):
        with pytest.raises(TypeError, match="must be a path or a file"):
            kind.load(wrong)
    with pytest.raises(ValueError, match="not an agent"):
        kind.load(memory)  # at its end
