"""Learning from a plant: the indirect interplay of §7.3 between it and the ants."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from tqdm import tqdm

from acl_gym.envs.learned import Transitions
from acl_gym.model_based.learning_run import LearningRun
from acl_gym.model_based.result import PlantLearning
from acl_gym.utils import validation
from acl_gym.utils.typing import Row


def learn_from_plant(
    env: Any,
    agent: Any = None,
    interactions: int = 200,
    *,
    rounds: Any = None,
    explore: float = 0.2,
    hold: int = 3,
    restart_after: int | None = None,
    inputs: Any = None,
    goal: Any = None,
    tolerance: Any = None,
    cost: Any = None,
    initial: Any = None,
    max_episode_steps: int | None = None,
    model: dict[str, Any] | None = None,
    model_steps: int | None = None,
    data: Transitions | None = None,
    circular: Any = None,
    folder: str | os.PathLike[str] | None = None,
    asynchronous: bool = False,
    callback: Callable[[PlantLearning, Row], Any] | None = None,
    progress_bar: bool = False,
    seed: int | None = None,
) -> PlantLearning:
    """Learn a policy for a plant from few interactions with it.

    In each round the plant runs with the best policy so far and some exploration, what
    it did is recorded, and a model is fitted to all recordings. Where it agrees with the
    one before, the colony goes on learning in it, its pheromone kept; otherwise a new
    colony learns. All policies are compared in the newest model, and the best is applied
    to the plant in the next round.

    >>> import gymnasium as gym
    >>> from acl_gym import learn_from_plant
    >>> plant = gym.make("acl_gym/Pendulum-v0")
    >>> learned = learn_from_plant(plant, interactions=120, restart_after=10, seed=0)
    >>> len(learned.transitions)
    120

    Args:
        env: the plant, a single or a vector environment with a Box of one axis as
            observations. In a vector environment each slot is a plant.
        agent: what learns in the model: None takes a `ReturningACL`; an agent of this
            package, which then changes its environment; or a function of the model (a
            vector environment) that returns anything with `learn(total_timesteps=)` and
            `predict`, such as an agent of Stable-Baselines3 over a `VectorEnvAdapter`. Its
            best policy is kept as a deep copy of what chooses actions: its attribute
            `policy` if that has `predict`, else the agent. Of an agent that cannot be
            copied the last policy is taken, with a warning on the log.
        interactions: steps of the plant, of all slots together, >= 1; with `data` also
            0, to learn from what was recorded before and nothing else.
        rounds: after how many interactions the colony learns: a number of rounds of
            equal length, or the numbers of interactions. None takes
            20, 40, 60, 90, 120, 160, 200, and then half as many more each time.
        explore: share of steps with random actions, in [0, 1]; in the first round all
            are random.
        hold: for how many steps a random action is held, >= 1.
        restart_after: steps after which the plant is reset; None: where its episodes
            end. Where a reset is cheap and puts the plant anywhere, short runs tell more.
        inputs: what each action of the policy sets, `(n_actions,)` or
            `(n_actions, n_inputs)`. Of continuous actions None takes five values from end
            to end of each input. Where the environment numbers its actions and does not
            tell what they set, and you know it, say so: a model then learns from one
            action what another does.
        goal: see `LearnedVectorEnv`. None takes that of an environment of this package,
            and of others what is learned from terminations.
        tolerance: see there.
        cost: the same; what is not known is learned from rewards.
        initial: where ants start in the model; see `LearnedVectorEnv`. None: half of
            them in recorded states, half anywhere within the bounds.
        max_episode_steps: T in the model; None takes the limit of `env`, or 300.
        model: further arguments of `LearnedVectorEnv`, such as `regressor`, `pessimism`
            or `uncertain`. With more than two variables `pessimism` is a tenth of the
            most that a step costs, unless you say otherwise.
        model_steps: the most steps of all ants in the model in a round, >= 1. None takes
            20,000 with one or two state variables, four times as many with each more,
            but at most 150,000. A round in which the colony goes on ends earlier if two
            fifths of them brought no better policy.
        data: what was recorded of this plant before. The colony learns from it before
            the first interaction. Its variables and inputs must be those of `env`, in the
            same order and units, with the same sampling time. Its inputs need not be
            those of the actions. Names, the sampling time, bounds and circular variables
            are taken from it where `env` does not tell them.
        circular: names or numbers of the variables that wrap around, such as an angle
            that jumps from pi to -pi, beside those of which `env` tells. They wrap around
            at the ends of the Box of observations; where it has none, at those of `data`,
            or else at -pi and pi. An angle shown as cosine and sine needs no word.
        folder: where every interaction is written down as soon as it was made, and the
            agent after each round. A call with the same arguments goes on with a run
            that was killed, or in which the plant has raised an error: no interaction is
            lost, and none is made twice. One run at a time may use it.
        asynchronous: let the plant run in a thread of its own, at its own pace, with
            whatever policy is the best at the moment, while the colony learns from what
            was recorded so far and waits for nothing. For a plant whose steps take time;
            the run is then not the same again with the same seed.
        callback: called with the learning so far and the row of each round; learning
            ends if it returns False.
        progress_bar: show a bar of interactions.
        seed: of the plant, of exploration and of the default agent.

    Returns:
        The policy, and everything that led to it.

    Raises:
        TypeError: the environment, the agent or an argument is of the wrong kind.
        ValueError: an argument is out of range, `data` is of another plant, or the folder
            holds another run.
    """
    asynchronous = validation.boolean("asynchronous", asynchronous)
    progress_bar = validation.boolean("progress_bar", progress_bar)
    run = LearningRun(
        env,
        agent,
        interactions,
        rounds,
        explore=explore,
        hold=hold,
        restart_after=restart_after,
        inputs=inputs,
        task={"goal": goal, "tolerance": tolerance, "cost": cost},
        initial=initial,
        max_episode_steps=max_episode_steps,
        model=model,
        model_steps=model_steps,
        data=data,
        circular=circular,
        folder=folder,
        seed=seed,
    )
    try:
        with tqdm(total=run.interactions, unit="step", disable=not progress_bar) as bar:
            return run.complete(callback, bar.update, asynchronous=asynchronous)
    finally:
        run.close()
