"""The work of `acl-gym train`: a new or a resumed agent learns and is saved."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from gymnasium import spaces

from acl_gym import Crisp, CSVLog, Fuzzy, PolicyEvaluation, TensorBoardLog
from acl_gym.agents.suitable import BY_RANK, PROBES, suitable_deposit
from acl_gym.callbacks import Callback
from acl_gym.cli.agents import AGENTS, name_of
from acl_gym.cli.common import print_json
from acl_gym.cli.environments import Environment, default_steps
from acl_gym.cli.errors import (
    BadArgumentError,
    InterruptedRunError,
    bad_arguments,
    report,
)
from acl_gym.cli.interrupts import Interruption
from acl_gym.cli.keeping import EqualCosts, Keeper, PlainProgress
from acl_gym.cli.learning_report import failed, how_to_go_on, print_rows, summary
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.graph.travelling_salesman.lookup import salesman_of
from acl_gym.partitions.automatic import automatic_partition

ANTS, FOREIGN_ANTS = 250, 200
"""Of the thesis's pendulum; in other packages' environments found on CartPole."""

FEW_ANTS = 5
"""Slots by default for agents that learn from few."""

TRIALS = 100
EVALUATE_EVERY = 10
FOREIGN_EVALUATE_EVERY = 2
"""In environments of other packages good policies may last for a trial or two."""

FOREIGN_EPISODES = 100
"""Episodes of an evaluation if the environment has no evaluation states."""

RANDOM_STEPS = 10_000
"""Random steps from which missing bounds of observations are estimated."""


class Shown(NamedTuple):
    """What is printed besides errors.

    Attributes:
        quiet: neither progress nor a table.
        as_json: JSON on stdout in their place.
    """

    quiet: bool
    as_json: bool

    @property
    def progress(self) -> bool:
        """Whether progress is shown."""
        return not (self.quiet or self.as_json)


@dataclass
class Plan:
    """What is to be learned.

    Attributes:
        learner: the agent.
        environment: where.
        evaluation: how its policy is evaluated.
        trials: how many trials are to be made now.
    """

    learner: Any
    environment: Environment
    evaluation: PolicyEvaluation
    trials: int


def begin(
    environment: Environment,
    kind: str,
    settings: dict[str, Any],
    *,
    ants: int | None,
    partition: str,
    cells: list[int] | None,
    max_steps: int | None,
    seed: int,
    evaluate_every: int | None,
    trials: int,
    chosen_for: bool = False,
) -> Plan:
    """A new agent.

    Args:
        environment: where.
        kind: a key of `AGENTS`.
        settings: parameters of the agent.
        ants: slots; None takes as many as are usual.
        partition: "auto", "fuzzy" or "crisp".
        cells: of each variable, one number for all, or None.
        max_steps: the most steps of an episode; None takes the limit.
        seed: of the agent.
        evaluate_every: trials between evaluations; None takes what is usual.
        trials: how many.
        chosen_for: whether the agent was chosen for the user, who may then want to know
            of a better one.

    Raises:
        BadArgumentError: an argument does not suit the environment or the agent.
    """
    grows = settings.get("grows")
    if grows is None:
        grows = AGENTS[kind].grows
    ants = ants or _default_ants(environment, kind, grows, settings)
    env = environment.vector(ants)
    if chosen_for and salesman_of(env) is not None:
        report(
            "acl-gym",
            f"note: --agent {kind} learns a policy that does not see where it has been; "
            "--agent max-min is made for shortest tours.",
        )
    if AGENTS[kind].seeks_best:
        _check_states(environment, env, kind, partition)
    steps = max_steps or default_steps(env)
    with bad_arguments():
        grid = None  # the agent chooses, coarse cells to begin with
        if not grows or cells or partition != "auto":
            grid = automatic_partition(
                env,
                kind=Crisp if partition == "crisp" else Fuzzy,
                cells=cells[0] if cells and len(cells) == 1 else cells,
                random_steps=max(RANDOM_STEPS, env.num_envs),
            )
    if AGENTS[kind].deposits and not {"deposit", "cost"} & settings.keys():
        settings = {**settings, **_deposit(environment, steps, seed)}
    with bad_arguments():
        learner = AGENTS[kind].load()(env, grid, max_steps=steps, seed=seed, **settings)
    own = environment.is_own
    every = evaluate_every or (EVALUATE_EVERY if own else FOREIGN_EVALUATE_EVERY)
    evaluation = _evaluation(environment, env, every, steps)
    learner.metadata = {
        **environment.facts,
        "ants": ants,
        "evaluation": {
            "episodes": None if evaluation.env is env else evaluation.env.num_envs,
            "max_steps": steps,
            "seed": evaluation.seed,
            "every": every,
        },
    }
    return Plan(learner, environment, evaluation, trials)


def go_on(
    environment: Environment,
    learner: Any,
    changes: dict[str, Any],
    ants: int | None,
    evaluate_every: int | None,
    trials: int | None,
) -> Plan:
    """A saved agent that goes on.

    Args:
        environment: where.
        learner: as it was loaded.
        changes: parameters that are different from now on.
        ants: None takes as many as before.
        evaluate_every: None takes what it was.
        trials: how many more; None takes what was left of an interrupted run.

    Raises:
        BadArgumentError: a parameter is fixed, or the environment does not fit.
    """
    known = learner.metadata
    kind = name_of(learner)
    few = AGENTS[kind].grows or getattr(learner, "grows", False)
    usual = _default_ants(environment, kind, few, learner.parameters())
    ants = ants or _count(known.get("ants"), usual)
    how = known.get("evaluation", {})
    how = how if isinstance(how, dict) else {}
    every = evaluate_every or _count(how.get("every"), EVALUATE_EVERY)
    env = environment.vector(ants)
    with bad_arguments():
        learner.set_env(env)
        for name, value in changes.items():
            setattr(learner, name, value)
    evaluation = _evaluation(environment, env, every, learner.max_steps)
    if trials is None:
        left = _count(known.get("planned_trials"), 0) - learner.trials
        trials = left if left > 0 else TRIALS
    learner.metadata = {
        **environment.facts,
        **known,
        "ants": ants,
        "evaluation": {
            "episodes": None if evaluation.env is env else evaluation.env.num_envs,
            "max_steps": learner.max_steps,
            "seed": evaluation.seed,
            "every": every,
        },
    }
    if learner.history:
        _as_if_uninterrupted(learner, evaluation)
    return Plan(learner, environment, evaluation, trials)


def _as_if_uninterrupted(learner: Any, evaluation: PolicyEvaluation) -> None:
    """Make the last row what it is in the middle of a run.

    The last trial of a run is evaluated in any case, and that of an interrupted run
    perhaps not.
    """
    row = learner.history[-1]
    if row["trial"] % evaluation.every:
        for name in ("policy_cost", "policy_return", "success_rate"):
            row.pop(name, None)
    else:
        evaluation.on_training_end(learner)


def _check_states(
    environment: Environment, env: Any, kind: str, partition: str
) -> None:
    """Refuse states on a scale where an agent needs cells.

    Raises:
        BadArgumentError: the environment has such states, and no cells were asked for.
    """
    space = env.single_observation_space
    if isinstance(space, spaces.Box) and partition != "crisp":
        raise BadArgumentError(
            f"--agent {kind} needs states that are cells, such as Discrete(48), but "
            f"{environment.name} has {space}; take --agent returning or --agent acl, or "
            "make cells with --partition crisp."
        )


def _default_ants(
    environment: Environment, kind: str, few: bool, settings: dict[str, Any]
) -> int:
    """How many slots there are where the user does not say.

    Args:
        environment: where.
        kind: a key of `AGENTS`.
        few: whether the agent learns from few.
        settings: parameters of the agent.
    """
    if few:
        return FEW_ANTS
    if AGENTS[kind].seeks_best:
        salesman = salesman_of(environment.vector(1))
        if salesman is not None:
            n_cities, search = salesman.instance.n_cities, settings.get("local_search")
            with bad_arguments():
                return int(AGENTS[kind].load().usual_ants(n_cities, search))
    return ANTS if environment.is_own else FOREIGN_ANTS


def _count(value: Any, default: int) -> int:
    """A number from a file, if it is one."""
    usable = isinstance(value, int) and not isinstance(value, bool) and value > 0
    return value if usable else default


def _deposit(environment: Environment, steps: int, seed: int) -> dict[str, Any]:
    """A deposit for rewards that are not negative costs, with a note; else nothing."""
    deposit = suitable_deposit(environment.vector(PROBES), steps, seed)
    if deposit is None:
        return {}
    report(
        "acl-gym",
        f"note: the rewards of {environment.name} are not negative costs, so the ants "
        f"deposit by their rank, --param deposit=rank:{BY_RANK.exponent:g}; "
        "deposit=return and deposit=inverse_cost:OFFSET are other choices.",
    )
    return {"deposit": deposit}


def _evaluation(
    environment: Environment, env: Any, every: int, steps: int
) -> PolicyEvaluation:
    """Evaluate from the environment's evaluation states, or from fixed random ones."""
    if not isinstance(env.unwrapped, ControlVectorEnv):
        env = environment.vector(FOREIGN_EPISODES)
    return PolicyEvaluation(env, every=every, max_steps=steps)


def run(
    plan: Plan,
    target: Path,
    best: Path | None,
    checkpoint_every: int | None,
    *,
    log: Path | None,
    tensorboard: Path | None,
    shown: Shown,
) -> None:
    """Learn, save, and print what came of it.

    Args:
        plan: what is to be learned.
        target: the file of the agent.
        best: the file of the best one; None writes none.
        checkpoint_every: trials between checkpoints; None writes one each minute.
        log: a CSV file, or None.
        tensorboard: a folder, or None.
        shown: what is printed.

    Raises:
        InterruptedRunError: a signal has ended it; the agent is saved.
    """
    learner, evaluation = plan.learner, plan.evaluation
    begun, last = learner.trials, learner.trials + plan.trials
    learner.metadata["planned_trials"] = last
    evaluation.save_best = best
    failure: Exception | None = None
    with bad_arguments():
        watchers: list[Callback] = [evaluation]
        if log is not None:
            watchers.append(CSVLog(log))
        if tensorboard is not None:
            watchers.append(TensorBoardLog(tensorboard))
    on_terminal = sys.stderr.isatty()
    if shown.progress and not on_terminal:
        watchers.append(PlainProgress(last))
    if AGENTS[name_of(learner)].deposits and not shown.quiet:
        watchers.append(EqualCosts())
    if begun and shown.progress:
        report(
            "acl-gym",
            f"going on after trial {begun} for {plan.trials} more, to trial {last}.",
        )
    with Interruption() as interruption:
        keeper = Keeper(target, checkpoint_every, interruption)
        try:
            learner.learn(
                trials=plan.trials,
                callback=[*watchers, keeper],
                progress_bar=shown.progress and on_terminal,
            )
        except KeyboardInterrupt:
            if not interruption.wanted:
                raise
        except Exception as error:
            failure = error
        interruption.learning_is_over()
        keeper.undo_trial(learner)
        if learner.trials > begun:
            learner.save(target)
    stopped = learner.trials < last
    if failure is not None:
        raise failed(failure, learner, begun, target) from failure
    if stopped:
        raise InterruptedRunError(
            how_to_go_on(learner, begun, last, target), interruption.exit_code
        )
    if shown.as_json:
        print_json(summary(learner, evaluation.saved, target, best))
    elif not shown.quiet:
        print_rows(learner, evaluation.saved, target, best)
