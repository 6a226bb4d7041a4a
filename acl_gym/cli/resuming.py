"""What `acl-gym train --resume` takes over from a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from acl_gym.cli.agents import load_agent, name_of, parameters
from acl_gym.cli.environments import (
    Environment,
    check_named_by_file,
    from_metadata,
)
from acl_gym.cli.errors import BadArgumentError, report

if TYPE_CHECKING:
    from acl_gym.cli.learning import Plan


def resumed_plan(
    file: Path,
    typed: Environment | None,
    arguments: dict[str, Any],
    bins: tuple[int, ...] | None,
    *,
    agent: str | None,
    param: list[str],
    unchanged: dict[str, int | None],
    ants: int | None,
    evaluate_every: int | None,
    trials: int | None,
) -> Plan:
    """An agent of a file that goes on learning.

    Args:
        file: the file.
        typed: the environment that the user named; None where that was left out.
        arguments: of the environment, as typed.
        bins: of `--discretize`, as typed.
        agent: of `--agent`, as typed.
        param: of `--param`, as typed.
        unchanged: options that cannot be changed, with the values typed.
        ants: see `learning.go_on`.
        evaluate_every: see there.
        trials: see there.

    Raises:
        BadArgumentError: there is no such file, or an option does not suit it.
    """
    from acl_gym.cli import learning
    from acl_gym.cli.settings import parse_parameters

    learner = load_agent(str(file))
    environment = _environment(file, learner, typed, arguments, bins)
    known = name_of(learner)
    if agent not in (None, known):
        raise BadArgumentError(
            f"--agent must be {known}, as in {file}, got {agent!r}; leave it out."
        )
    if agent is None and "deposit" not in parameters(known):
        param = _without_deposit(param, known)
    changes = parse_parameters("--param", param, parameters(known))
    now = {"--seed": learner.seed, "--max-steps": learner.max_steps}
    for option, value in unchanged.items():
        if value not in (None, now[option]):
            raise BadArgumentError(
                f"{option} must be {now[option]}, as in {file}, got {value}; leave it "
                "out."
            )
    return learning.go_on(environment, learner, changes, ants, evaluate_every, trials)


def _without_deposit(param: list[str], known: str) -> list[str]:
    """Leave out a deposit, with a note, where the agent that goes on does not need one.

    It says how ants turn costs into pheromone, and lets them learn from rewards of any
    sign. Other agents do so without it, so that a script that always sets it still works.
    """
    kept = [each for each in param if each.partition("=")[0].strip() != "deposit"]
    if len(kept) < len(param):
        report(
            "acl-gym",
            f"note: --param deposit is left out: this file holds --agent {known}, which "
            "takes rewards of any sign as they are.",
        )
    return kept


def _environment(
    file: Path,
    learner: Any,
    typed: Environment | None,
    arguments: dict[str, Any],
    bins: tuple[int, ...] | None,
) -> Environment:
    """The environment that a file names, or the user where it names none."""
    found = from_metadata(str(file), learner.metadata)
    if found is None:
        if typed is None:
            raise BadArgumentError(
                f"{file} does not name its environment; name it: acl-gym train ENV_ID "
                f"--resume {file}."
            )
        typed.import_module()
        return typed
    if typed is not None and typed.name != found.name:
        raise BadArgumentError(
            f"{file} was trained in {found.name}, got {typed.name}; leave ENV_ID out to "
            "go on there."
        )
    if bins is not None and found.bins is not None and len(bins) != len(found.bins):
        same = len(set(bins) | set(found.bins)) == 1
    else:
        same = bins in (None, found.bins)
    if bins is not None and (found.end_to_end or not same):
        known = () if found.end_to_end else found.bins or ()
        raise BadArgumentError(
            f"--discretize must be {','.join(map(str, known)) or 'left out'}, as in "
            f"{file}, got {','.join(map(str, bins))}."
        )
    for name, value in arguments.items():
        if found.arguments.get(name, value) != value or name not in found.arguments:
            raise BadArgumentError(
                f"--env-arg {name} must be as in {file}, "
                f"{found.arguments.get(name, 'where it is not set')!r}, got {value!r}; "
                "leave it out."
            )
    if typed is not None and typed.module:
        typed.import_module()
    untyped = {k: v for k, v in found.arguments.items() if k not in arguments}
    check_named_by_file(str(file), Environment(found.env_id, untyped, found.bins), "")
    return found
