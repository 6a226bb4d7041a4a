"""The work of `acl-gym train --interactions` and `--from-data`: learning in a model."""

from __future__ import annotations

import csv
import io
import math
import sys
import tempfile
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from acl_gym.agents.suitable import suitable_deposit
from acl_gym.cli.agents import AGENTS, load_agent
from acl_gym.cli.common import print_json
from acl_gym.cli.environments import Environment, default_steps
from acl_gym.cli.errors import (
    BadArgumentError,
    InterruptedRunError,
    bad_arguments,
    report,
)
from acl_gym.cli.evaluate import evaluate_agent
from acl_gym.cli.interrupts import Interruption
from acl_gym.cli.learning import EVALUATE_EVERY, FEW_ANTS, FOREIGN_EPISODES, Shown
from acl_gym.cli.plant_options import PlantOptions
from acl_gym.cli.plant_report import facts_of_model, print_found
from acl_gym.cli.targets import checked_file
from acl_gym.envs.learned import Transitions
from acl_gym.envs.learned.description import described_by
from acl_gym.evaluation import policy_measures
from acl_gym.model_based import PlantLearning, learn_from_plant
from acl_gym.model_based.arguments import VALUES, task_of
from acl_gym.model_based.default_agent import default_agent
from acl_gym.model_based.journal import AGENT, BEST
from acl_gym.model_based.plant_facts import CLOSE
from acl_gym.utils import files
from acl_gym.utils.typing import FloatArray, Row

DATA_STEPS = 100_000
"""The most steps of all ants where there is one round only."""


def run(
    options: PlantOptions,
    environment: Environment,
    kind: str,
    settings: dict[str, Any],
    *,
    target: Path,
    max_steps: int | None,
    seed: int,
    log: Path | None,
    shown: Shown,
) -> None:
    """Learn, save, evaluate, and print what came of it.

    Args:
        options: how many steps, and what was recorded.
        environment: the plant.
        kind: what learns in the model, a key of `AGENTS`.
        settings: parameters of the agent.
        target: the file of the agent; its best policy and the folder of the plant are
            named after it.
        max_steps: the most steps of an episode in the model and in evaluation; None
            takes the limit.
        seed: of the plant and the agent.
        log: a CSV file, or None.
        shown: what is printed.

    Raises:
        BadArgumentError: an argument does not suit the environment or the data.
        InterruptedRunError: a signal has ended it; what was recorded is kept.
    """
    if AGENTS[kind].seeks_best:
        raise BadArgumentError(
            f"--agent {kind} looks for one solution through cells, and cannot learn in a "
            "model of measurements; take returning, acl or q-learning."
        )
    if environment.bins is None and environment.has_real_inputs():
        environment = environment.from_end_to_end(VALUES)
    numbered = environment.vector(1)  # fails now for actions that cannot be numbered
    steps = max_steps or default_steps(numbered)
    best_file = checked_file(target.with_name(f"{target.stem}-best.npz"))
    plant, inputs = _plant(environment)
    with bad_arguments():
        described_by(plant)  # fails now for observations that are no numbers
    data = _data(options, plant)
    if data is not None:
        for doubt in data.doubts():
            report("acl-gym", f"warning: {doubt}")
    agent = _agent(kind, settings, numbered if environment.is_own else None, seed)
    if log is not None:
        with bad_arguments():
            files.checked_target(log)
    count = options.interactions or 0
    watch = _Watch(count, log, shown)
    folder = target.with_name(f"{target.stem}-plant") if count else None
    if folder is not None and folder.exists():
        watch.goes_on = f"going on with what was recorded in {folder}."
    how: dict[str, Any] = {} if count else {"model_steps": DATA_STEPS}
    with (
        Interruption() as interruption,
        nullcontext(folder) if folder else tempfile.TemporaryDirectory() as kept,
    ):
        watch.interruption = interruption
        try:
            with bad_arguments():
                learned = learn_from_plant(
                    plant,
                    agent,
                    count,
                    restart_after=options.restart_after,
                    inputs=inputs,
                    max_episode_steps=steps,
                    data=data,
                    circular=options.circular_variables(data),
                    folder=kept,
                    callback=watch,
                    progress_bar=count > 0 and shown.progress and sys.stderr.isatty(),
                    seed=seed,
                    **how,
                )
        except KeyboardInterrupt:
            if not interruption.wanted:
                raise
            learned = None
        except BadArgumentError as error:
            if folder is None or "give another folder" not in str(error):
                raise
            raise BadArgumentError(
                str(error).replace(
                    "give another folder", "give another name with --out FILE.npz"
                )
            ) from error
        interruption.learning_is_over()
        if learned is None or interruption.wanted:
            raise InterruptedRunError(_how_to_go_on(folder), interruption.exit_code)
        agents = [load_agent(str(Path(kept) / name)) for name in (AGENT, BEST)]
    found = []
    for each, file in zip(agents, (target, best_file), strict=True):
        cost, metadata = _evaluated(each, environment, steps)
        measures = policy_measures(cost, numbered)
        each.metadata = metadata
        each.history[-1] |= measures  # --resume knows the best policy by them
        each.save(file)
        found.append({"file": str(file), **measures})
    facts: dict[str, Any] = {
        **agents[0].metadata,
        "agent": kind,
        "interactions": count,
        "recorded_steps": len(learned.transitions),
        "seconds": watch.rows[-1]["seconds"] if watch.rows else None,
        "policy_cost": None,
        "success_rate": None,
        **found[0],
        "best": found[1],
        "plant": None if folder is None else str(folder),
        "data": _facts_of_data(options, data),
        "model": facts_of_model(learned, plant),
        "rows": learned.history,
    }
    if shown.as_json:
        print_json(facts)
    elif not shown.quiet:
        print_found(facts)


class _Watch:
    """Writes the log and the progress after each round, and stops at a signal."""

    def __init__(self, count: int, log: Path | None, shown: Shown) -> None:
        self._count, self._log, self._shown = count, log, shown
        self.rows: list[Row] = []
        self.interruption: Interruption | None = None
        self.goes_on = ""  # said with the first round, when no argument can be wrong

    def __call__(self, learned: PlantLearning, row: Row) -> bool:
        self.rows = learned.history
        if self.goes_on and not self._shown.quiet:
            report("acl-gym", self.goes_on)
            self.goes_on = ""
        if self._log is not None:
            text = io.StringIO(newline="")
            writer = csv.DictWriter(text, list(self.rows[0]))
            writer.writeheader()
            writer.writerows(self.rows)
            files.write_atomically(self._log, text.getvalue().encode())
        if self._shown.progress and not sys.stderr.isatty():
            of = f"{row['interactions']} of {self._count} interactions, "
            report(
                "acl-gym",
                f"{of if self._count else ''}{row['seconds']:.1f} s, error of the model "
                f"{row['model_error']:.3f}, cost in the model {row['model_cost']:.4g}",
            )
        return self.interruption is None or not self.interruption.wanted


def _plant(environment: Environment) -> tuple[Any, FloatArray | None]:
    """What is stepped, and the values of its actions where they are continuous."""
    if environment.is_own:
        return environment.vector(1), None
    with bad_arguments():
        if environment.bins is None:
            return environment.single(), None
        numbered: Any = environment.single()
        values = [numbered.action(n) for n in range(int(numbered.action_space.n))]
        plain = environment.with_real_inputs().single()
    return plain, np.asarray(values, np.float64).reshape(len(values), -1)


def _data(options: PlantOptions, plant: Any) -> Transitions | None:
    """The recorded steps.

    Raises:
        BadArgumentError: there is no such file, or it is not of this environment.
    """
    file = options.from_data
    if file is None:
        return None
    with bad_arguments():
        facts = described_by(plant)
        size, n_inputs = facts.pop("size"), facts.pop("n_inputs")
        kind = options.kind_of_table
        if kind is None:
            found = Transitions.load(file)
        elif kind == "csv":
            found = Transitions.from_csv(file, **options.columns)
        else:
            found = Transitions.from_parquet(file, **options.columns)
        shape = found.states.shape[1], found.inputs.shape[1]
        if shape != (size, n_inputs):
            raise BadArgumentError(
                f"{file} must have {size} variables and {n_inputs} inputs, as the "
                f"environment has, got {shape[0]} and {shape[1]}."
            )
        time, own_time = found.sampling_time, facts.get("sampling_time")
        if time and own_time and not math.isclose(time, own_time, rel_tol=CLOSE):
            raise BadArgumentError(
                f"{file} must have a sampling time of {own_time:g} s, as the environment "
                f"has, got {time:g} s."
            )
        if found.rewards is None and "cost" not in task_of(plant, {}):
            remedy = "record rewards too" if kind is None else "add --reward COLUMN"
            raise BadArgumentError(
                f"{file} must hold rewards, from which the cost is learned, since the "
                f"environment does not tell its own; {remedy}."
            )
        known = found.description
        if not facts.get("numbered") or known.numbered:
            return found
        # The numbers in a table are those of actions: the environment has nothing else.
        return Transitions(
            found.states,
            found.inputs,
            found.next_states,
            found.rewards,
            found.terminated,
            episodes=found.episodes,
            state_names=known.state_names,
            circular=known.circular,
            sampling_time=known.sampling_time,
            low=known.low,
            high=known.high,
            values=facts["values"],
            numbered=True,
        )


def _agent(
    kind: str, settings: dict[str, Any], env: Any, seed: int
) -> Callable[[Any], Any]:
    """What makes the agent of a model.

    Args:
        kind: a key of `AGENTS`.
        settings: its parameters.
        env: where they are tried before the first step; None where bounds are missing.
        seed: of the agent.
    """
    if kind == "returning":
        make = default_agent(seed, **settings)
    else:

        def make(model: Any) -> Any:
            chosen = dict(settings)
            if AGENTS[kind].deposits and not {"deposit", "cost"} & chosen.keys():
                deposit = suitable_deposit(model, model.max_episode_steps, seed)
                if deposit is not None:
                    chosen["deposit"] = deposit
            return AGENTS[kind].load()(model, seed=seed, **chosen)

    if env is not None:
        with bad_arguments():
            make(env)
    return make


def _evaluated(
    agent: Any, environment: Environment, steps: int
) -> tuple[Any, dict[str, Any]]:
    """What a policy costs in the environment, and what the file says about that."""
    cost, _ = evaluate_agent(agent, agent, environment, None, None, steps, 0)
    return cost, {
        **environment.facts,
        "ants": FEW_ANTS,
        "evaluation": {
            "episodes": None if environment.is_own else FOREIGN_EPISODES,
            "max_steps": steps,
            "seed": 0,
            "every": EVALUATE_EVERY,
        },
    }


def _facts_of_data(
    options: PlantOptions, data: Transitions | None
) -> dict[str, Any] | None:
    if data is None:
        return None
    return {
        "file": str(options.from_data),
        "steps": len(data),
        "doubts": data.doubts(),
    }


def _how_to_go_on(folder: Path | None) -> str:
    if folder is None:
        return "interrupted; nothing is saved."
    return (
        f"interrupted; every step is in {folder}. The same command goes on from there "
        "and makes those that are left."
    )
