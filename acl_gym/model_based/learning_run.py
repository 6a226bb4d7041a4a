"""One run of `learn_from_plant`: plant, recordings, model and colony, round after round."""

from __future__ import annotations

import logging
import os
import threading
import time
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from acl_gym.agents.base import TabularAgent
from acl_gym.envs.learned import (
    DataWarning,
    LearnedDynamics,
    LearnedVectorEnv,
    Transitions,
)
from acl_gym.envs.learned.regression import LEAST_STEPS
from acl_gym.model_based.arguments import (
    check_actions,
    check_plant,
    episode_steps,
    inputs_of_actions,
    round_ends,
    task_of,
    usual_model_steps,
)
from acl_gym.model_based.default_agent import default_agent
from acl_gym.model_based.improving import Improving
from acl_gym.model_based.journal import AGENT, BEST, Journal, State
from acl_gym.model_based.plant_facts import arrays_of, facts_of_plant, joined
from acl_gym.model_based.plant_runner import PlantRunner
from acl_gym.model_based.result import PlantLearning
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray, Row

logger = logging.getLogger("acl_gym")

ANTS = 50
"""Slots of the model."""

COMPARED, MORE_COMPARED = 100, 300
"""States from which policies are compared in the model: with up to two variables, and
with more, where few would make the choice a matter of luck."""

Callback = Callable[[PlantLearning, Row], Any] | None


class LearningRun:
    """The state of one run of `learn_from_plant`, whose arguments it takes.

    Attributes:
        interactions: how many are made altogether.
    """

    def __init__(
        self,
        env: Any,
        agent: Any,
        interactions: int,
        rounds: Any,
        *,
        explore: float,
        hold: int,
        restart_after: int | None,
        inputs: Any,
        task: dict[str, Any],
        initial: Any,
        max_episode_steps: int | None,
        model: dict[str, Any] | None,
        model_steps: int | None,
        data: Transitions | None,
        circular: Any,
        folder: str | os.PathLike[str] | None,
        seed: int | None,
    ) -> None:
        # Where there is data to learn from, no interaction need be made.
        least = 1 if data is None else 0
        self.interactions = validation.integer(
            "interactions", interactions, at_least=least
        )
        self._ends = round_ends(rounds, self.interactions)
        if data is not None and self._ends[0] > 0:
            self._ends = [0, *self._ends]
        if model_steps is not None:
            model_steps = validation.integer("model_steps", model_steps, at_least=1)
        self._model_steps = model_steps
        explore = validation.number("explore", explore, at_least=0, at_most=1)
        hold = validation.integer("hold", hold, at_least=1)
        if restart_after is not None:
            restart_after = validation.integer(
                "restart_after", restart_after, at_least=1
            )
        if data is not None and not isinstance(data, Transitions):
            raise TypeError(
                f"data must be acl_gym.Transitions, got {validation.shown(data)}."
            )
        if self.interactions + (0 if data is None else len(data)) < LEAST_STEPS:
            raise ValueError(
                f"interactions must be {LEAST_STEPS} or more to learn from, got "
                f"{self.interactions}."
            )
        seed = validation.seed(seed)
        check_plant(env)
        self._task = task_of(env, task)
        self._initial, self._data = initial, data
        if not isinstance(model, Mapping | None):
            raise TypeError(
                "model must be a dict of arguments of LearnedVectorEnv, such as "
                f'{{"pessimism": 1.0}}, got {validation.shown(model)}.'
            )
        self._arguments = dict(model or {})
        if "inputs" in self._arguments:
            raise ValueError(
                "model must not hold inputs, since plant and model must have the same "
                "actions; give inputs= of learn_from_plant."
            )
        self._steps = episode_steps(env, max_episode_steps)
        values = inputs_of_actions(env, inputs)
        self._facts = facts_of_plant(env, values, circular, data)
        if data is not None:
            joined([arrays_of(data)], self._facts)  # fails now, before the plant moves
        check_actions(agent, env, values)
        self._journal: Journal | None = None
        self._before: dict[str, Any] | None = None
        if folder is not None:
            settings = {
                "explore": explore,
                "hold": hold,
                "restart_after": restart_after,
                "seed": seed,
                "inputs": None if values is None else values.tolist(),
                "circular": None if circular is None else [*self._facts["circular"]],
            }
            self._journal = Journal(folder, settings, env, values)
            self._before = self._journal.arrays
        made = 0 if self._before is None else len(self._before["states"])
        try:
            self._runner = PlantRunner(
                env,
                inputs=values,
                explore=explore,
                hold=hold,
                restart_after=restart_after,
                # A run that goes on does not repeat the numbers of its beginning.
                seed=None if seed is None else seed + made,
            )
            self._made_before = made
            self._improving = Improving(
                default_agent(seed) if agent is None else agent,
                None if self._journal is None else self._journal.path(BEST),
            )
            self._model: LearnedVectorEnv | None = None
            state = None if self._journal is None else self._journal.kept_state()
            self._learned_at, self._seconds, self._history = state or State(-1, 0.0, [])
        except BaseException:
            self.close()  # lets others use the folder
            raise

    def close(self) -> None:
        """Close the file of interactions, and let others use the folder."""
        if self._journal is not None:
            self._journal.close()

    def complete(
        self,
        callback: Callback,
        progress: Callable[[int], Any],
        *,
        asynchronous: bool,
    ) -> PlantLearning:
        """Make all interactions that are left, and learn from them.

        Args:
            callback: see `learn_from_plant`.
            progress: called with the number of new interactions.
            asynchronous: see there.
        """
        if callback is not None and not callable(callback):
            raise TypeError(
                "callback must be a function of the learning and a row, got "
                f"{validation.shown(callback)}."
            )
        progress(self._made_before)
        try:
            self._go_on()
            if asynchronous:
                self._side_by_side(callback, progress)
            else:
                self._in_turn(callback, progress)
        except Exception as error:
            self._tell_what_is_kept(error)
            raise
        return self._result()

    def _tell_what_is_kept(self, error: Exception) -> None:
        """Add to an error, of the plant perhaps, that no interaction is lost."""
        made = self._interactions
        if self._journal is not None and made:
            kept = "The interaction" if made == 1 else f"All {made:,} interactions"
            error.add_note(
                f"{kept} made so far {'is' if made == 1 else 'are'} kept in "
                f"{self._journal.folder}; run the same again, and it goes on from there."
            )

    def _go_on(self) -> None:
        """Take up the model and the best policy of a run that was killed.

        So that the plant follows this policy from the first step.
        """
        if self._journal is None or self._learned_at < 0 or self._too_few():
            return
        # As it was when the colony learned in it: what came later may contradict it.
        known = self._learned_at + (0 if self._data is None else len(self._data))
        self._model = self._fitted(self._recorded()[:known], None)
        files = self._journal.path(AGENT), self._journal.path(BEST)
        if files[0].exists():
            self._improving.restore(*files, self._model)
        self._runner.policy = self._improving.best
        if self._improving.best is None:  # its file is gone
            self._learn()
            self._keep()

    def _in_turn(self, callback: Callback, progress: Callable[[int], Any]) -> None:
        """Plant and colony take turns."""
        for end in self._ends:
            before = self._interactions
            while self._interactions < end:
                self._runner.step(self._journal)
            progress(self._interactions - before)
            if end <= self._learned_at or self._too_few():
                continue
            row = self._learn()
            self._keep()
            if callback is not None and callback(self._result(), row) is False:
                return

    def _side_by_side(self, callback: Callback, progress: Callable[[int], Any]) -> None:
        """The plant runs in a thread of its own, and nobody waits."""
        stop, failed = threading.Event(), []

        def run_plant() -> None:
            try:
                while self._interactions < self.interactions and not stop.is_set():
                    self._runner.step(self._journal)
            except BaseException as error:  # raised again below, in the other thread
                failed.append(error)

        plant = threading.Thread(target=run_plant, name="plant", daemon=True)
        plant.start()
        seen = self._interactions
        try:
            while True:
                done = not plant.is_alive()
                if failed:
                    raise failed[0]
                if self._too_few():
                    if done:
                        break
                    plant.join(0.01)
                    continue
                now = self._interactions
                if now == self._learned_at and done:
                    break
                row = self._learn()
                progress(now - seen)
                seen = now
                self._keep()
                if callback is not None and callback(self._result(), row) is False:
                    break
                if done:
                    break
        finally:
            stop.set()
            plant.join()

    @property
    def _interactions(self) -> int:
        return self._made_before + self._runner.steps

    def _too_few(self) -> bool:
        more = 0 if self._data is None else len(self._data)
        return more + self._interactions < LEAST_STEPS

    def _recorded(self) -> Transitions:
        """Everything that is known of the plant."""
        parts = [] if self._data is None else [arrays_of(self._data)]
        if self._before is not None:
            parts.append(self._before)
        if self._runner.steps:
            parts.append(self._runner.arrays())
        return joined(parts, self._facts)

    def _learn(self) -> Row:
        """Fit the model to everything recorded, and let the colony go on in it."""
        began = time.perf_counter()
        recorded = self._recorded()
        before = 0 if self._data is None else len(self._data)
        self._learned_at = len(recorded) - before
        begin: LearnedDynamics | None = (
            None if self._model is None else self._model.dynamics
        )
        model = self._model = self._fitted(recorded, begin)
        states = self._compared(model)
        most_steps = self._model_steps or usual_model_steps(model.system.low.size)
        steps = self._improving.improve(model, states, most_steps)
        self._runner.policy = self._improving.best
        self._seconds += time.perf_counter() - began
        row: Row = {
            "interactions": self._interactions,
            "seconds": self._seconds,
            "model_error": float(np.mean(list(model.dynamics.errors.values()))),
            "model_cost": float(self._improving.cost),
            "model_steps": steps,
        }
        self._history.append(row)
        logger.info(
            "%d interactions: %r; the best policy costs %.4g in the model.",
            self._interactions,
            model.dynamics,
            row["model_cost"],
        )
        return row

    def _compared(self, model: LearnedVectorEnv) -> FloatArray:
        """States from which policies are compared, `(n, n_variables)`.

        Half of them where the plant has begun, from where it will be asked again. With
        many variables these are a few points of a large space, and recorded states lie
        along the ways to the goal; so the other half is spread evenly.
        """
        rng, system = np.random.default_rng(0), model.system
        n_variables = system.low.size
        if n_variables <= 2:
            half = COMPARED // 2
            others = system.sample_states(rng, half).T[:, :n_variables]
        else:
            half = MORE_COMPARED // 2
            others = rng.uniform(system.low, system.high, (half, n_variables))
        begun = system.variables(model.transitions.starts)
        begun = begun[rng.integers(len(begun), size=half)]
        return np.concatenate([others, np.clip(begun, system.low, system.high)])

    def _fitted(
        self, recorded: Transitions, begin: LearnedDynamics | None
    ) -> LearnedVectorEnv:
        arguments: dict[str, Any] = {
            "max_episode_steps": self._steps,
            "begin": begin,
            "pessimism": None,
            **self._task,
            **self._arguments,
        }
        if self._initial is None:
            arguments["initial"] = "anywhere"
        else:
            arguments["initial"] = self._initial
        with warnings.catch_warnings():
            # That there are few steps is the point, and from one start a plant without
            # noise repeats itself.
            warnings.simplefilter("ignore", DataWarning)
            return LearnedVectorEnv(recorded, ANTS, **arguments)

    def _result(self) -> PlantLearning:
        improving = self._improving
        if self._model is None or improving.best is None:
            raise ValueError(
                f"at least {LEAST_STEPS} interactions are needed to learn from, got "
                f"{self._interactions}; ask for more."
            )
        return PlantLearning(
            improving.best,
            improving.agent,
            self._model,
            self._model.transitions,
            [dict(row) for row in self._history],
        )

    def _keep(self) -> None:
        """Save the agent, and how far the run has come."""
        if self._journal is None or not isinstance(self._improving.agent, TabularAgent):
            return
        self._improving.agent.save(self._journal.path(AGENT))
        state = State(self._learned_at, self._seconds, self._history)
        self._journal.keep_state(state)
