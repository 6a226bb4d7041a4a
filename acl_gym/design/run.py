"""From a plant to a folder with a controller and a report."""

from __future__ import annotations

import io
import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acl_gym.design import pictures
from acl_gym.design.advice import (
    advice,
    advice_on_limits,
    advice_on_model,
    fault_of_model,
)
from acl_gym.design.learning import CHOOSING, GOOD, Learned, Progress, learn
from acl_gym.design.limits import Limits, measure_limits
from acl_gym.design.measures import Measures, measure, typical, worst
from acl_gym.design.page import write_page
from acl_gym.design.plants import as_vector_env, load_plant
from acl_gym.design.simulation import Responses, simulate
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.plant import Plant
from acl_gym.evaluation import evaluate_over_range
from acl_gym.experiments.provenance import circumstances
from acl_gym.policies import TablePolicy
from acl_gym.utils import files, validation
from acl_gym.utils.typing import FloatArray

STARTS = 1_000
"""Random starts of the figures in the report."""

SECONDS = 60.0
"""The default time limit of learning."""

PLANTS = 50
"""Plants that are drawn from the range of uncertain parameters."""


@dataclass(frozen=True)
class Design:
    """What was designed.

    Attributes:
        folder: where the files are.
        policy: the controller.
        measures: what it does from the random starts.
        limits: what its success owes to `low` and `high`, where the model stops.
        learned: how it was learned.
        advice: what to try, where the goal is not reached from 95% of the starts, where
            success is owed to a limit of the range, or where the model has a fault.
        model_fault: why the figures say nothing about the plant, where its model was
            learned from a recording and is unsure almost everywhere; else None.
        summary: what `summary.json` holds.
    """

    folder: Path
    policy: TablePolicy
    measures: Measures
    limits: Limits
    learned: Learned
    advice: tuple[str, ...]
    model_fault: str | None
    summary: dict[str, Any]

    @property
    def succeeded(self) -> bool:
        """Whether the goal is reached from 95% of the starts, in a model to be believed."""
        return self.measures.success_rate >= GOOD and self.model_fault is None


def design(
    plant: Any,
    out: str | Path,
    *,
    seed: int = 0,
    seconds: float | None = SECONDS,
    steps: int | None = None,
    source: Path | None = None,
    command: str | None = None,
    stop: Callable[[], bool] = lambda: False,
    tell: Callable[[Progress], None] = lambda progress: None,
    on_learned: Callable[[], None] = lambda: None,
) -> Design:
    """Learn a controller for a plant, and write it with a report into a folder.

    The folder gets `policy.h` (C), `policy.npz` (NumPy), `policy.png`,
    `trajectories.png`, `starts.png`, `learning.png`, `summary.json`, `report.html`, which
    holds all of it, and `plant.py`, a copy of the file.

    Args:
        plant: what `acl_gym.plant` returns, or a `LearnedVectorEnv`; or the path of a
            Python file that makes one, see `load_plant`. The file is run. Its slots, if
            there are two or more, are the ants; else there are 5, or 10 for three
            variables and more.
        out: the folder; it is made if it does not exist, and files of these names in it
            are replaced.
        seed: >= 0; the same seed and number of interactions give the same controller.
        seconds: the most seconds for learning, > 0; None sets no limit.
        steps: learn for so many interactions, >= 1, whether or not the policy still
            improves; None ends when it has stopped improving.
        source: the file that describes a plant which is given itself; a copy of it is
            written into the folder.
        command: what repeats this, for the report; None writes it in Python.
        stop: asked after each trial; True ends learning, and the best policy so far is
            kept.
        tell: called after each evaluation.
        on_learned: called when learning is over, before anything is written.

    Returns:
        The controller and what is known of it.

    Raises:
        FileNotFoundError: there is no such file, or no folder in which to make `out`.
        ValueError: the file describes no plant, or an argument is out of range.
        TypeError: `plant` is something else, or an argument has the wrong type.

    Example:
        >>> from acl_gym.design import design
        >>> made = design("pendulum.py", "pendulum", seed=0)  # doctest: +SKIP
        >>> made.measures.success_rate  # doctest: +SKIP
        1.0
    """
    begun = time.monotonic()
    seed = validation.integer("seed", seed, at_least=0)
    if seconds is not None:
        seconds = validation.number("seconds", seconds, above=0)
    if steps is not None:
        steps = validation.integer("steps", steps, at_least=1)
    folder = checked_folder(out)
    if isinstance(plant, str | Path):
        source = Path(plant)
        env = load_plant(source)
    else:
        env = as_vector_env(plant)
    system: Any = env.system
    learned = learn(
        env,
        draw_starts(system, CHOOSING, seed, 1),
        seed=seed,
        seconds=seconds,
        steps=steps,
        stop=stop,
        tell=tell,
    )
    on_learned()
    folder.mkdir(exist_ok=True)
    measured = _measured(learned, env, folder, seed)
    repeated = _command(command, source, folder, seed, learned)
    return _written(folder, source, env, learned, measured, repeated, seed, begun)


@dataclass(frozen=True)
class _Measured:
    """What is known of a controller.

    Attributes:
        measures: over the random starts.
        limits: how often its paths touch the ends of the range.
        robustness: over uncertain parameters, or None.
        model: of a learned model, or None.
        figures: the names of the pictures, which are written.
    """

    measures: Measures
    limits: Limits
    robustness: dict[str, Any] | None
    model: dict[str, Any] | None
    figures: tuple[str, ...]


def _measured(learned: Learned, env: Any, folder: Path, seed: int) -> _Measured:
    """Simulate the controller from random starts, and draw."""
    system: Any = env.system
    starts = draw_starts(system, STARTS, seed, 2)[:, : system.low.size]
    responses = simulate(learned.policy, env, starts, 2 * system.evaluation_steps, seed)
    figures = _draw(learned, responses, env, system)
    model = None
    if is_learned(env):
        from acl_gym.design.recordings import model_facts
        from acl_gym.design.spread import draw_spread

        model = model_facts(env, responses)
        figures["model"] = draw_spread(learned.policy, env)
    for name, figure in figures.items():
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=pictures.DPI)
        files.write_atomically(folder / f"{name}.png", buffer.getvalue())
    return _Measured(
        measure(responses, system),
        measure_limits(responses, learned.policy, env),
        _robustness(learned.policy, env, starts, seed),
        model,
        tuple(figures),
    )


def _written(
    folder: Path,
    source: Path | None,
    env: ControlVectorEnv,
    learned: Learned,
    measured: _Measured,
    command: str,
    seed: int,
    begun: float,
) -> Design:
    """Write the controller, the figures and the page."""
    system: Any = env.system
    measures = measured.measures
    learned.policy.to_c(folder / "policy.h")
    learned.policy.to_numpy(folder / "policy.npz")
    if source is not None:
        name = "plant.py" if measured.model is None else f"data{source.suffix}"
        files.write_atomically(folder / name, source.read_bytes())
    tips = advice(learned, measures, system)
    tips += advice_on_limits(measured.limits, measures, system)
    fault = fault_of_model(measured.model)
    if fault is not None and measured.model is not None:
        # A better controller of a poor model is no gain: its data come first.
        tips = advice_on_model(measured.model)
    facts = {
        "plant": "acl_gym.plant(...)" if source is None else str(source),
        "reaches_goal": measures.success_rate >= GOOD,
        **measures.as_dict(),
        "cost": measures.cost.mean,
        "costs": asdict(measures.cost),
        "limits": asdict(measured.limits),
        "uncertain": measured.robustness,
        "model": measured.model,
        "model_fault": fault,
        "seed": seed,
        "command": command,
        "interactions": learned.interactions,
        "interactions_of_best": learned.interactions_of_best,
        "learning_seconds": learned.seconds,
        "ended": learned.ended,
        "ants": learned.ants,
        "advice": tips,
        "controller": _facts(learned.policy, folder),
        "made": circumstances(1),
        "seconds": time.monotonic() - begun,
    }
    summary: dict[str, Any] = _plain(facts)
    text = json.dumps(summary, indent=1)
    files.write_atomically(folder / "summary.json", text.encode())
    write_page(
        folder, summary, learned, measures, measured.limits, system, measured.figures
    )
    return Design(
        folder=folder,
        policy=learned.policy,
        measures=measures,
        limits=measured.limits,
        learned=learned,
        advice=tuple(tips),
        model_fault=fault,
        summary=summary,
    )


def checked_folder(out: str | Path) -> Path:
    """Return a folder into which files can be written; it need not exist yet.

    Raises:
        FileNotFoundError: there is no folder to make it in.
        NotADirectoryError: it is a file.
        OSError: it cannot be written.
    """
    folder = validation.path("out", out)
    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(
            f"{folder} is a file; give the name of a folder, new or old."
        )
    target = folder / "summary.json" if folder.exists() else folder
    files.checked_target(target, "give a folder elsewhere")
    return folder


def is_learned(env: Any) -> bool:
    """Whether a plant is a `LearnedVectorEnv`.

    Asked so because the libraries of regression take a second to import, which a plant
    with equations should not cost.
    """
    return hasattr(env, "transitions")


def draw_starts(plant: Plant, count: int, seed: int, stream: int) -> FloatArray:
    """Random starts, `(count, state_size)`, others for each number of the stream.

    Args:
        plant: the system, which says where episodes begin.
        count: how many.
        seed: >= 0.
        stream: >= 0; those of 1 choose among policies, those of 2 are reported on.
    """
    rng = np.random.default_rng([seed, stream])
    return np.ascontiguousarray(plant.sample_states(rng, count).T)


def _robustness(
    policy: TablePolicy, env: ControlVectorEnv, starts: FloatArray, seed: int
) -> dict[str, Any] | None:
    """Nominal and worst cost over the uncertain parameters; None where none are."""
    system: Any = env.system
    if not system.parameters.count:
        return None
    found = evaluate_over_range(
        policy, env, draws=PLANTS, seed=seed, states=starts[:CHOOSING]
    )
    return {
        "plants": len(found.costs),
        "nominal_cost": found.nominal.cost,
        "nominal_success_rate": found.nominal.success_rate,
        "worst_cost": found.worst.cost,
        "worst_success_rate": found.worst.success_rate,
        "worst_parameters": found.worst_parameters,
        "lowest_success_rate": float(np.min(found.success_rates)),
        "median_cost": float(np.median(found.costs)),
        "ranges": {
            n: list(map(float, e)) for n, e in system.parameters.uncertain.items()
        },
    }


def _draw(
    learned: Learned, responses: Responses, env: ControlVectorEnv, system: Plant
) -> dict[str, Any]:
    shown = [responses.one(typical(responses)), responses.one(worst(responses))]
    return {
        "policy": pictures.draw_policy(learned.policy, env, system),
        "trajectories": pictures.draw_responses(
            shown, ["typical start", "worst start"], env
        ),
        "starts": pictures.draw_starts(responses, learned.policy, env),
        "learning": pictures.draw_learning(learned),
    }


def _command(
    command: str | None, source: Path | None, folder: Path, seed: int, learned: Learned
) -> str:
    """What gives the same controller again, on any machine."""
    steps = learned.interactions
    if command is not None:
        return f"{command} --seed {seed} --steps {steps}"
    what = "plant" if source is None else repr(str(source))
    return f"design({what}, {str(folder)!r}, seed={seed}, steps={steps}, seconds=None)"


def _facts(policy: TablePolicy, folder: Path) -> dict[str, Any]:
    """How large a controller is."""
    header = (folder / "policy.h").read_text(encoding="utf-8")
    about = header[: header.index("*/")]
    return {
        "partition": repr(policy.partition),
        "cells": policy.partition.n_cells,
        "actions": policy.n_actions,
        "about": about.removeprefix("/* ").replace("\n *", "\n").strip(),
    }


def _plain(value: Any) -> Any:
    """Numbers that JSON knows: what is not finite becomes None."""
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
