"""PETS of mbrl-lib on a plant of this package, for few_interactions.py.

PETS (Chua et al. 2018) learns an ensemble of networks that predict the next state, and
plans in it with the cross-entropy method before each step. It is told what
learn_from_plant is told: cost and goal, that an angle is circular, and it may reset the
plant as often. Its input is continuous; the plant gets the nearest of its own. Population,
horizon and networks are smaller than in the paper, so that a step takes a
quarter of a second on a processor; a policy is judged from `STARTS` of the evaluation
states.

It needs an environment of its own, which `make peers-pets` makes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import mbrl.models
import mbrl.planning
import mbrl.util.common
import numpy as np
import omegaconf
import torch
from gymnasium import spaces
from numpy.typing import NDArray

from few_plants import Measured, PlantTask  # isort: skip  # the script beside this one

STARTS = 10
"""Of the 100 evaluation states, every tenth."""

HORIZON = 25
"""Steps of a plan: the best policies take 24 on average to the goal."""

POPULATION, GENERATIONS, PARTICLES = 100, 3, 4
"""Plans in a generation, generations, and predictions of each plan."""

EVERY = 20
"""Steps of the plant between two fits of the ensemble."""

EPOCHS = 100


class Seen:
    """The plant as PETS meets it: cosine and sine of angles, inputs from -1 to 1.

    Raises:
        ValueError: the plant is of another package, or its cost is not quadratic.
    """

    def __init__(self, task: PlantTask, seed: int) -> None:
        if not task.is_own or task.learned_task:
            raise ValueError(
                "pets is run on plants of this package with a given cost; leave "
                "--learned-task out, or --methods pets."
            )
        self.env: Any = task.plant()
        self.limit = task.limit
        system = self.env.unwrapped.system
        self.inputs = np.array(system.signals.values)
        self.scale = np.abs(self.inputs).max(axis=0)
        self.circular = np.array(
            [axis in system.circular for axis in range(len(system.task["goal"]))]
        )
        self.system = system
        self._seed: int | None = seed

    def reset(self, state: NDArray[np.float64] | None = None) -> NDArray[np.float32]:
        options = None if state is None else {"state": state[None]}
        found, _ = self.env.reset(seed=self._seed, options=options)
        self._seed = None
        return self.features(found[0])

    def step(
        self, action: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], float, bool]:
        """What follows, the cost, and whether the goal is reached."""
        wanted = np.asarray(action) * self.scale
        nearest = int(np.abs(self.inputs - wanted).sum(axis=1).argmin())
        self.used = self.inputs[nearest] / self.scale
        found, rewards, ended, _, _ = self.env.step(np.array([nearest]))
        return self.features(found[0]), -float(rewards[0]), bool(ended[0])

    def features(self, state: NDArray[np.float64]) -> NDArray[np.float32]:
        angles, others = state[self.circular], state[~self.circular]
        parts = np.cos(angles), np.sin(angles), others
        return np.concatenate(parts).astype(np.float32)

    def error(self, seen: Any) -> Any:
        """x - x_g of a batch of features, a tensor `(n, n_variables)`."""
        count = int(self.circular.sum())
        angles = torch.atan2(seen[:, count : 2 * count], seen[:, :count])
        goal = torch.as_tensor(np.array(self.system.task["goal"]), dtype=seen.dtype)
        error = torch.empty((len(seen), len(goal)), dtype=seen.dtype)
        wide = angles - goal[self.circular]
        error[:, self.circular] = torch.remainder(wide + math.pi, 2 * math.pi) - math.pi
        error[:, ~self.circular] = seen[:, 2 * count :] - goal[~self.circular]
        return error

    def rewards(self, actions: Any, seen: Any) -> Any:
        """Minus the stage cost, `(n, 1)`."""
        state_weight, input_weight = self.system.task["cost"]
        weight = torch.as_tensor(np.array(state_weight), dtype=seen.dtype)
        error = self.error(seen)
        inputs = actions * torch.as_tensor(self.scale, dtype=seen.dtype)
        cost = ((error @ weight) * error).sum(1)
        return -(cost + float(input_weight) * (inputs**2).sum(1))[:, None]

    def ended(self, actions: Any, seen: Any) -> Any:
        """Whether the goal is reached, `(n, 1)`."""
        half = torch.as_tensor(np.array(self.system.task["tolerance"]))
        return (self.error(seen).abs() <= half).all(1)[:, None]


class Pets:
    """The ensemble, its data and the planner.

    Args:
        seen: the plant.
        seed: of everything.
        most: interactions that are to be remembered.
    """

    def __init__(self, seen: Seen, seed: int, most: int) -> None:
        torch.set_num_threads(1)
        torch.manual_seed(seed)
        n_seen = int(seen.circular.sum()) + seen.circular.size
        n_inputs = seen.inputs.shape[1]
        network = {
            "_target_": "mbrl.models.GaussianMLP",
            "_recursive_": False,  # it makes its parts itself
            "device": "cpu",
            "num_layers": 3,
            "ensemble_size": 5,
            "hid_size": 64,
            "in_size": n_seen + n_inputs,
            "out_size": n_seen,
            "deterministic": False,
            "propagation_method": "fixed_model",
            "activation_fn_cfg": {"_target_": "torch.nn.SiLU"},
        }
        config = omegaconf.OmegaConf.create(
            {
                "dynamics_model": network,
                "algorithm": {
                    "learned_rewards": False,
                    "target_is_delta": True,
                    "normalize": True,
                    "dataset_size": most,
                },
                "overrides": {
                    "model_batch_size": 32,
                    "validation_ratio": 0.0,
                    "num_epochs_train_model": EPOCHS,
                    "patience": EPOCHS,
                },
            }
        )
        self._common, self._config = mbrl.util.common, config
        shapes = (n_seen,), (n_inputs,)
        self._model = self._common.create_one_dim_tr_model(config, *shapes)
        self._data = self._common.create_replay_buffer(
            config, *shapes, rng=np.random.default_rng(seed)
        )
        self._trainer = mbrl.models.ModelTrainer(
            self._model, optim_lr=1e-3, weight_decay=5e-5
        )
        plant = _Spaces(
            spaces.Box(-np.inf, np.inf, shapes[0]), spaces.Box(-1.0, 1.0, shapes[1])
        )
        generator = torch.Generator().manual_seed(seed)
        imagined: Any = mbrl.models.ModelEnv(
            plant,  # type: ignore[arg-type]
            self._model,
            seen.ended,
            seen.rewards,
            generator=generator,
        )
        planner = {
            "_target_": "mbrl.planning.TrajectoryOptimizerAgent",
            "_recursive_": False,
            "planning_horizon": HORIZON,
            "replan_freq": 1,
            "verbose": False,
            "action_lb": [-1.0] * n_inputs,
            "action_ub": [1.0] * n_inputs,
            "optimizer_cfg": {
                "_target_": "mbrl.planning.CEMOptimizer",
                "num_iterations": GENERATIONS,
                "elite_ratio": 0.1,
                "population_size": POPULATION,
                "alpha": 0.1,
                "device": "cpu",
                "lower_bound": "???",
                "upper_bound": "???",
                "return_mean_elites": True,
                "clipped_normal": False,
            },
        }
        self.planner = mbrl.planning.create_trajectory_optim_agent_for_model(
            imagined, omegaconf.OmegaConf.create(planner), num_particles=PARTICLES
        )

    def add(self, *step: Any) -> None:
        """Remember a step: features, input, next features, reward, whether it ended."""
        self._data.add(*step, False)

    def fit(self) -> None:
        """Train the ensemble on everything remembered."""
        self._common.train_model_and_save_model_and_data(
            self._model,
            self._trainer,
            self._config.overrides,
            self._data,
        )

    def judged(self, seen: Seen) -> Measured:
        """Follow the plans from some evaluation states."""
        states = seen.system.evaluation_states()
        costs, reached = [], []
        for state in states[:: len(states) // STARTS]:
            features, cost, ended, steps = seen.reset(state), 0.0, False, 0
            self.planner.reset()
            while not ended and steps < seen.limit:
                features, more, ended = seen.step(self.planner.act(features))
                cost, steps = cost + more, steps + 1
            costs.append(cost)
            reached.append(ended)
        return Measured(float(np.mean(costs)), float(np.mean(reached)))


class _Spaces:
    """What mbrl's model wants to know of an environment."""

    def __init__(self, observation_space: Any, action_space: Any) -> None:
        self.observation_space, self.action_space = observation_space, action_space


def run_pets(record: Any, task: PlantTask, seed: int, marks: Sequence[int]) -> None:
    """One run: random inputs until the first fit, then plans."""
    seen, judge = Seen(task, seed), Seen(task, seed)
    pets, rng = Pets(seen, seed, marks[-1]), np.random.default_rng(seed)
    features, since = seen.reset(), 0
    fits = {*range(EVERY, marks[-1] + 1, EVERY), *marks}
    for made in range(1, marks[-1] + 1):
        if made <= EVERY:
            action = rng.uniform(-1.0, 1.0, len(seen.scale))
        else:
            action = pets.planner.act(features)
        after, cost, ended = seen.step(action)
        pets.add(features, seen.used, after, -cost, ended)
        features, since = after, since + 1
        if ended or since == (task.steps_of_a_run or seen.limit):
            features, since = seen.reset(), 0
            pets.planner.reset()
        if made in fits:
            pets.fit()
        if made == record.next:
            record.judge_by(lambda: pets.judged(judge), made)
            pets.planner.reset()
