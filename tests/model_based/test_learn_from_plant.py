"""Learning from few interactions with a plant."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

from acl_gym import (
    ACL,
    PlantLearning,
    QLearning,
    ReturningACL,
    Transitions,
    VectorEnvAdapter,
    evaluate_policy_cost,
    learn_from_plant,
)
from acl_gym.envs.learned.system import CAUTION
from acl_gym.model_based.arguments import round_ends
from acl_gym.model_based.journal import DATA
from tests.model_based.plants import QUICK, pendulum, quick

J_STAR = 38.4  # of the pendulum, by value iteration on a fine grid


def test_sixty_interactions_swing_the_pendulum_up() -> None:
    learned = learn_from_plant(pendulum(), interactions=60, restart_after=10, seed=0)
    assert len(learned.transitions) == 60
    assert [row["interactions"] for row in learned.history] == [20, 40, 60]
    found = evaluate_policy_cost(learned.policy, gym.make_vec("acl_gym/Pendulum-v0"))
    assert found.success_rate == 1.0
    assert found.cost < 1.25 * J_STAR
    assert isinstance(learned.agent, ReturningACL)
    actions, _ = learned.predict(np.array([[0.0, 0.0], [3.0, 0.1]]))
    assert actions.shape == (2,)


def test_the_same_seed_gives_the_same_policy() -> None:
    policies: Any = [
        learn_from_plant(pendulum(), interactions=30, seed=1, **QUICK).policy
        for _ in range(2)
    ]
    np.testing.assert_array_equal(policies[0].table, policies[1].table)


def test_what_was_learned_is_kept_from_round_to_round() -> None:
    tables = []

    def note(learning: PlantLearning, row: Any) -> None:
        tables.append(learning.agent.table.copy())

    learn_from_plant(
        pendulum(), interactions=40, rounds=2, seed=0, callback=note, **QUICK
    )
    before, after = tables
    # Of pairs that were not tried again nothing has changed.
    assert ((before == after) & (before != 0)).any()
    assert (before != after).any()


def test_an_agent_that_is_there_goes_on_in_the_model() -> None:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5)
    colony = ACL(env, seed=0)
    learned = learn_from_plant(
        pendulum(), colony, 20, restart_after=10, model_steps=500, seed=0
    )
    assert learned.agent is colony
    assert colony.env is learned.model
    assert colony.num_timesteps >= 500


def test_an_agent_of_stable_baselines_learns_in_the_model() -> None:
    from stable_baselines3 import A2C

    def make(model: Any) -> Any:
        return A2C(
            "MlpPolicy", VectorEnvAdapter(model), n_steps=2, device="cpu", seed=0
        )

    learned = learn_from_plant(
        pendulum(), make, 30, rounds=2, restart_after=10, model_steps=200, seed=0
    )
    assert isinstance(learned.agent, A2C)
    assert len(learned.history) == 2
    assert isinstance(learned.policy, type(learned.agent.policy))
    assert learned.policy is not learned.agent.policy  # a copy, which stays the best


def test_several_plants_run_side_by_side() -> None:
    env = SyncVectorEnv([pendulum] * 3)
    learned = learn_from_plant(env, quick, 31, rounds=[10], model_steps=400, seed=0)
    assert len(learned.transitions) == 33  # whole steps of all three
    assert [row["interactions"] for row in learned.history] == [12, 33]


def test_episodes_in_the_model_last_as_long_as_those_of_the_plant() -> None:
    def made() -> gym.Env[Any, Any]:
        return gym.make("acl_gym/Pendulum-v0", max_episode_steps=40)

    for env in (made(), SyncVectorEnv([made])):
        learned = learn_from_plant(env, quick, 20, model_steps=400, seed=0)
        assert learned.model.max_episode_steps == 40


def test_what_was_recorded_before_is_used() -> None:
    data = Transitions.record(pendulum(), 25, seed=5)
    learned = learn_from_plant(pendulum(), interactions=10, data=data, seed=0, **QUICK)
    assert len(learned.transitions) == 35
    np.testing.assert_array_equal(learned.transitions.states[:25], data.states)


def test_continuous_actions_are_chosen_from_a_grid() -> None:
    learned = learn_from_plant(
        gym.make("Pendulum-v1"), quick, 25, model_steps=300, seed=0
    )
    values = learned.model.system.inputs
    np.testing.assert_allclose(values[:, 0], np.linspace(-2, 2, 5))
    assert set(learned.transitions.inputs[:, 0]) <= set(values[:, 0])
    given = learn_from_plant(
        gym.make("Pendulum-v1"), quick, 25, inputs=[-2, 2], model_steps=300, seed=0
    )
    assert len(given.model.system.inputs) == 2


def test_the_share_of_random_actions_is_as_asked() -> None:
    """A policy that pushes to the right always; the random actions are told apart."""

    class Right:
        def __init__(self, model: Any) -> None:
            self.env = model

        def learn(self, total_timesteps: int) -> None:
            pass

        def predict(self, observation: Any, **how: Any) -> Any:
            return np.full(len(observation), 2), None

    for explore in (0.0, 0.3, 1.0):
        learned = learn_from_plant(
            pendulum(),
            Right,
            420,
            rounds=[20],
            explore=explore,
            model_steps=1,
            seed=0,
        )
        others = (learned.transitions.inputs[20:, 0] != 0.8).mean()
        # Two thirds of random actions are others; four standard errors of held ones.
        assert others == pytest.approx(explore * 2 / 3, abs=4 * np.sqrt(0.25 * 3 / 400))


def test_each_round_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO", logger="acl_gym"):
        learn_from_plant(pendulum(), interactions=20, rounds=2, seed=0, **QUICK)
    said = [r.getMessage() for r in caplog.records if "interactions:" in r.getMessage()]
    assert len(said) == 2
    assert said[1].startswith("20 interactions: LearnedDynamics(gaussian process")


def test_a_callback_ends_learning() -> None:
    seen = []

    def stop(learning: PlantLearning, row: Any) -> bool:
        seen.append(row["interactions"])
        return False

    learned = learn_from_plant(
        pendulum(), interactions=40, rounds=4, callback=stop, seed=0, **QUICK
    )
    assert seen == [10]
    assert len(learned.transitions) == 10


def test_rounds() -> None:
    assert round_ends(None, 100) == [20, 40, 60, 90, 100]
    assert round_ends(None, 500) == [20, 40, 60, 90, 120, 160, 200, 300, 450, 500]
    assert round_ends(4, 10) == [2, 5, 8, 10]
    assert round_ends([5, 3, 50], 20) == [3, 5, 20]


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"interactions": 0}, ValueError, "interactions must"),
        ({"explore": 1.5}, ValueError, "explore must"),
        ({"hold": 0}, ValueError, "hold must"),
        ({"rounds": "many"}, (ValueError, TypeError), "rounds must"),
        ({"rounds": 300}, ValueError, "rounds must"),
        ({"inputs": [0.0]}, ValueError, "inputs belong to continuous actions"),
        (
            {"agent": 3},
            TypeError,
            "agent must be an agent of this package or a function",
        ),
        ({"agent": lambda model: 3}, TypeError, "the agent must have learn"),
        ({"data": [1]}, TypeError, r"data must be acl_gym\.Transitions"),
        ({"callback": 3}, TypeError, "callback must be a function"),
        ({"model": {"colour": 1}}, TypeError, "colour"),
        ({"model": [1]}, TypeError, "model must be a dict"),
        ({"asynchronous": "no"}, TypeError, "asynchronous must be True or False"),
        ({"progress_bar": 1}, TypeError, "progress_bar must be True or False"),
        ({"interactions": 3}, ValueError, "interactions must be 5 or more"),
    ],
)
def test_bad_arguments_get_one_clear_error(
    arguments: dict[str, Any], error: Any, message: str
) -> None:
    with pytest.raises(error, match=message):
        learn_from_plant(
            pendulum(), **{"seed": 0, **QUICK, "interactions": 20, **arguments}
        )


@pytest.mark.parametrize("env", ["acl_gym/Pendulum-v0", 3, None])
def test_what_is_no_environment_is_refused(env: Any) -> None:
    with pytest.raises(TypeError, match="env must be an environment of Gymnasium"):
        learn_from_plant(env, interactions=10)


def test_actions_that_no_table_has_are_refused() -> None:
    with pytest.raises(TypeError, match="a Box of one axis"):
        learn_from_plant(gym.make("Taxi-v4"), interactions=10)


class TestFolder:
    """Every interaction is written down as soon as it was made."""

    def run(
        self, folder: Path, interactions: int = 40, **changed: Any
    ) -> PlantLearning:
        return learn_from_plant(
            pendulum(),
            interactions=interactions,
            rounds=[10, 20, 30],
            folder=folder,
            seed=0,
            **{**QUICK, **changed},
        )

    def rows(self, folder: Path) -> list[list[str]]:
        with (folder / DATA).open(newline="") as file:
            return list(csv.reader(file))[1:]

    def test_the_file_holds_what_was_recorded(self, tmp_path: Path) -> None:
        learned = self.run(tmp_path / "run")
        rows = np.array(self.rows(tmp_path / "run"), dtype=float)
        assert len(rows) == 40
        np.testing.assert_array_equal(rows[:, 1:3], learned.transitions.states)
        np.testing.assert_array_equal(rows[:, 4:6], learned.transitions.next_states)

    def test_a_run_that_is_complete_makes_no_more_interactions(
        self, tmp_path: Path
    ) -> None:
        first = self.run(tmp_path)
        again = self.run(tmp_path)
        assert len(self.rows(tmp_path)) == 40
        np.testing.assert_array_equal(
            first.transitions.states, again.transitions.states
        )
        assert again.policy is not None
        more = self.run(tmp_path, interactions=50)
        assert len(self.rows(tmp_path)) == 50
        assert len(more.transitions) == 50
        np.testing.assert_array_equal(
            more.transitions.states[:40], first.transitions.states
        )
        assert more.transitions.episodes.max() > first.transitions.episodes.max()

    @pytest.mark.parametrize("asynchronous", [False, True])
    def test_an_error_of_the_plant_tells_what_is_kept(
        self, tmp_path: Path, asynchronous: bool
    ) -> None:
        class Blown(gym.Wrapper[Any, Any, Any, Any]):
            left = 12

            def step(self, action: Any) -> Any:
                self.left -= 1
                if self.left < 0:
                    raise ConnectionError("the fuse has blown")
                return self.env.step(action)

        def learn(env: Any, folder: Path | None) -> Any:
            return learn_from_plant(
                env,
                interactions=20,
                folder=folder,
                asynchronous=asynchronous,
                seed=0,
                **QUICK,
            )

        with pytest.raises(ConnectionError) as caught:
            learn(Blown(pendulum()), tmp_path / "rig")
        (note,) = caught.value.__notes__
        assert f"All 12 interactions made so far are kept in {tmp_path}/rig" in note
        assert "run the same again" in note
        assert len(self.rows(tmp_path / "rig")) == 12
        assert len(learn(pendulum(), tmp_path / "rig").transitions) == 20
        with pytest.raises(ConnectionError) as caught:
            learn(Blown(pendulum()), None)
        assert not hasattr(caught.value, "__notes__")

    def test_a_line_that_was_not_completed_is_cut_off(self, tmp_path: Path) -> None:
        self.run(tmp_path, interactions=20)
        with (tmp_path / DATA).open("a") as file:
            file.write("9,1.5,2.")
        learned = self.run(tmp_path)
        assert len(learned.transitions) == 40
        assert len(self.rows(tmp_path)) == 40

    def test_another_run_is_refused(self, tmp_path: Path) -> None:
        self.run(tmp_path, interactions=10)
        with pytest.raises(ValueError, match="holds another run, with hold=3"):
            self.run(tmp_path, hold=4)
        (tmp_path / "run.json").unlink()
        with pytest.raises(ValueError, match=r"but no run\.json"):
            self.run(tmp_path)

    def test_more_interactions_are_learned_from(self, tmp_path: Path) -> None:
        """Though there are as many rounds as before."""
        for end in (25, 28):
            learned = self.run(tmp_path, interactions=end)
            assert learned.history[-1]["interactions"] == end
        assert [row["interactions"] for row in learned.history] == [10, 20, 25, 28]

    def test_what_a_thread_learned_is_not_lost(self, tmp_path: Path) -> None:
        first = self.run(tmp_path, asynchronous=True)
        again = self.run(tmp_path, interactions=45, asynchronous=True)
        assert again.agent.num_timesteps > first.agent.num_timesteps
        assert len(again.history) > len(first.history)

    def test_a_policy_that_is_gone_is_learned_again(self, tmp_path: Path) -> None:
        self.run(tmp_path, interactions=10)
        for name in ("agent.npz", "best.npz"):
            (tmp_path / name).unlink()
        assert self.run(tmp_path, interactions=10).policy is not None

    @pytest.mark.parametrize("asynchronous", [False, True])
    def test_a_run_that_goes_on_follows_its_best_policy_at_once(
        self, tmp_path: Path, asynchronous: bool
    ) -> None:
        """Not only from the end of its next round on."""

        class Failing(gym.Wrapper[Any, Any, Any, Any]):
            left = 22

            def step(self, action: Any) -> Any:
                self.left -= 1
                if self.left < 0:
                    raise ConnectionError("the fuse has blown")
                return self.env.step(action)

        def learn(env: Any, **more: Any) -> Any:
            return learn_from_plant(
                env,
                interactions=60,
                rounds=[20],
                explore=0.0,
                folder=tmp_path,
                seed=0,
                **{**QUICK, **more},
            )

        with pytest.raises(ConnectionError):
            learn(Failing(pendulum()))
        best = QLearning.load(tmp_path / "best.npz").policy
        learn(pendulum(), asynchronous=asynchronous)
        # A thread follows it until the first round ends, which takes longer than a step.
        rows = np.array(self.rows(tmp_path), dtype=float)[22:]
        rows = rows[:8] if asynchronous else rows
        torques = np.array([-0.8, 0.0, 0.8])
        actions, _ = best.predict(rows[:, 1:3])
        np.testing.assert_array_equal(rows[:, 3], torques[actions])

    def test_another_plant_is_refused(self, tmp_path: Path) -> None:
        self.run(tmp_path, interactions=10)
        with pytest.raises(ValueError, match="holds another run, with plant"):
            learn_from_plant(
                gym.make("MountainCar-v0"),
                interactions=10,
                folder=tmp_path,
                seed=0,
                **QUICK,
            )

    def test_one_run_at_a_time_uses_a_folder(self, tmp_path: Path) -> None:
        """Another process is refused while one learns, and not after it is killed."""
        program = f"""
import sys, time
sys.path.insert(0, {str(Path(__file__).parents[2])!r})
import gymnasium as gym
from acl_gym import learn_from_plant
from tests.model_based.plants import QUICK, pendulum

class Waiting(gym.Wrapper):
    left = 12

    def step(self, action):
        self.left -= 1
        if not self.left:
            print("waits", flush=True)
            time.sleep(300)
        return self.env.step(action)

learn_from_plant(Waiting(pendulum()), interactions=40, rounds=[10, 20, 30],
                 folder={str(tmp_path)!r}, seed=0, **QUICK)
"""
        with subprocess.Popen(
            [sys.executable, "-c", program], stdout=subprocess.PIPE, text=True
        ) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "waits\n"
            kept = self.rows(tmp_path)
            with pytest.raises(ValueError, match="used by one run at a time"):
                self.run(tmp_path)
            assert self.rows(tmp_path) == kept
            process.kill()
        assert len(self.run(tmp_path).transitions) == 40
        assert self.rows(tmp_path)[: len(kept)] == kept

    def test_a_run_that_is_refused_leaves_the_folder_to_others(
        self, tmp_path: Path
    ) -> None:
        self.run(tmp_path, interactions=10)
        errors = []  # kept, and with them the objects of the runs that were refused
        for changed in ({"hold": 4}, {"agent": 3}):
            with pytest.raises((ValueError, TypeError)) as caught:
                self.run(tmp_path, **changed)
            errors.append(caught.value)
        assert len(self.run(tmp_path, interactions=12).transitions) == 12

    def test_a_line_that_is_damaged_is_named(self, tmp_path: Path) -> None:
        self.run(tmp_path, interactions=10)
        lines = (tmp_path / DATA).read_text().splitlines(keepends=True)
        lines[3] = "0,a,1\n"
        (tmp_path / DATA).write_text("".join(lines))
        with pytest.raises(
            ValueError, match=r"line 4 of .* must hold 8 finite numbers"
        ):
            self.run(tmp_path, interactions=10)

    def test_a_file_is_no_folder(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        with pytest.raises(NotADirectoryError, match="folder must be a folder"):
            self.run(tmp_path / "file")

    def test_damaged_files_are_refused(self, tmp_path: Path) -> None:
        self.run(tmp_path, interactions=10)
        (tmp_path / "state.json").write_text("{")
        with pytest.raises(ValueError, match="cannot be read"):
            self.run(tmp_path)

    def test_nothing_is_lost_and_nothing_is_double_when_it_is_killed(
        self, tmp_path: Path
    ) -> None:
        """A plant that counts its steps; the process is killed in the middle."""
        program = f"""
import sys, time
sys.path.insert(0, {str(Path(__file__).parents[2])!r})
import gymnasium as gym
from acl_gym import learn_from_plant
from tests.model_based.plants import QUICK, pendulum

class Slow(gym.Wrapper):
    def step(self, action):
        result = self.env.step(action)
        time.sleep(0.01)
        with open({str(tmp_path / "steps")!r}, "a") as file:
            file.write(repr(result[0].tolist()) + "\\n")
        return result

learn_from_plant(Slow(pendulum()), interactions=60, rounds=[20, 40],
                 folder={str(tmp_path / "run")!r}, seed=0, **QUICK)
"""
        steps = tmp_path / "steps"
        process = subprocess.Popen([sys.executable, "-c", program])
        deadline = time.monotonic() + 120
        while not (steps.exists() and steps.read_text().count("\n") >= 30):
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.005)
        process.kill()
        process.wait()
        made = [json.loads(line) for line in steps.read_text().splitlines()]
        kept = np.array(self.rows(tmp_path / "run"), dtype=float)[:, 4:6]
        # The last step may have been made and not yet returned to the learner.
        assert len(made) - 1 <= len(kept) <= len(made)
        np.testing.assert_array_equal(kept, np.array(made)[: len(kept)])
        subprocess.run([sys.executable, "-c", program], check=True)
        rows = np.array(self.rows(tmp_path / "run"), dtype=float)
        assert len(rows) == 60
        np.testing.assert_array_equal(rows[: len(kept), 4:6], kept)
        assert len(np.unique(rows[:, 1:], axis=0)) == 60


class TestAsynchronous:
    """The plant runs in a thread of its own."""

    def test_all_interactions_are_made_and_learned_from(self) -> None:
        class Slow(gym.Wrapper[Any, Any, Any, Any]):
            def step(self, action: Any) -> Any:
                time.sleep(0.01)
                return self.env.step(action)

        learned = learn_from_plant(
            Slow(pendulum()), interactions=100, asynchronous=True, seed=0, **QUICK
        )
        assert len(learned.transitions) == 100
        seen = [row["interactions"] for row in learned.history]
        assert len(seen) >= 3
        assert seen[-1] == 100

    def test_what_fails_in_the_plant_is_raised(self) -> None:
        class Broken(gym.Wrapper[Any, Any, Any, Any]):
            count = 0

            def step(self, action: Any) -> Any:
                self.count += 1
                if self.count > 12:
                    raise RuntimeError("the fuse has blown")
                return self.env.step(action)

        with pytest.raises(RuntimeError, match="the fuse has blown"):
            learn_from_plant(
                Broken(pendulum()), interactions=100, asynchronous=True, seed=0, **QUICK
            )


def test_with_many_variables_ants_avoid_what_the_model_does_not_know() -> None:
    def learned(env: Any, **arguments: Any) -> Any:
        quickly = {"agent": quick, "model_steps": 400, "seed": 0, **arguments}
        return learn_from_plant(env, interactions=30, **quickly).model.system

    vehicle = gym.make("acl_gym/Navigation-v0")
    system = learned(vehicle)
    assert system.max_stage_cost > 0
    assert system.pessimism == pytest.approx(CAUTION * system.max_stage_cost)
    assert learned(vehicle, model={"pessimism": 0.5}).pessimism == 0.5
    assert learned(pendulum()).pessimism == 0
