"""What the tests of vector environments share."""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from acl_gym.envs.control.environments import ControlVectorEnv
from tests.envs.systems import SystemCase

MODES = [mode.value for mode in AutoresetMode]

StepResult = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]


def assert_same_bits(ours: np.ndarray, theirs: np.ndarray) -> None:
    """Equal in dtype, shape and every bit, the sign of zero included."""
    assert ours.dtype == theirs.dtype
    assert ours.shape == theirs.shape
    if ours.tobytes() != theirs.tobytes():
        np.testing.assert_array_equal(ours, theirs)
        raise AssertionError("equal numbers of other bits")


def assert_same_step(ours: StepResult, theirs: StepResult) -> None:
    """The same observations, rewards and flags, and the same infos."""
    for mine, other in zip(ours[:4], theirs[:4], strict=True):
        assert_same_bits(mine, other)
    assert_same_infos(ours[4], theirs[4])


def assert_same_infos(ours: dict[str, Any], theirs: dict[str, Any]) -> None:
    """The same keys, and for each the same array or the same infos below it."""
    assert sorted(ours) == sorted(theirs)
    for key, mine in ours.items():
        other = theirs[key]
        assert type(mine) is type(other), key
        if isinstance(mine, dict):
            assert_same_infos(mine, other)
        elif mine.dtype == object:
            assert mine.shape == other.shape
            for a, b in zip(mine, other, strict=True):
                assert (a is None) == (b is None)
                if a is not None:
                    assert_same_bits(a, b)
        else:
            assert_same_bits(mine, other)


def beside_masks(infos: dict[str, Any]) -> dict[str, Any]:
    """Infos without the mask of actions, which some systems always tell."""
    return {key: infos[key] for key in infos if not key.endswith("action_mask")}


def success_at_ends(result: StepResult) -> StepResult:
    """The step of single environments, which tell `is_success` in every step, as a
    native environment gives it: told where episodes end, and only then."""
    *rest, terminated, truncated, infos = result
    finished, told = terminated | truncated, infos.get("_is_success")
    infos = {key: infos[key] for key in infos if not key.endswith("is_success")}
    if told is not None and (told & finished).any():
        infos |= {"is_success": terminated, "_is_success": told & finished}
    return (*rest, terminated, truncated, infos)


def arrays_in(value: Any) -> list[np.ndarray]:
    """Every array of numbers in what `reset` or `step` returned."""
    if isinstance(value, dict):
        return [array for item in value.values() for array in arrays_in(item)]
    if isinstance(value, tuple):
        return [array for item in value for array in arrays_in(item)]
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [array for item in value for array in arrays_in(item)]
    return [value] if isinstance(value, np.ndarray) else []


def mask_of(num_envs: int, *slots: int) -> np.ndarray:
    """A mask that is True at some slots."""
    mask = np.zeros(num_envs, dtype=np.bool_)
    mask[list(slots)] = True
    return mask


def random_states(
    env: VectorEnv[Any, Any, Any], rng: np.random.Generator
) -> np.ndarray:
    """Initial states, one a slot, shape (num_envs, state_size)."""
    return env.unwrapped.system.sample_states(rng, env.num_envs).T.copy()


def step_and_reset(
    env: VectorEnv[Any, Any, Any],
    actions: np.ndarray,
    rng: np.random.Generator | None = None,
) -> StepResult:
    """Step; where nobody else does it, start the finished slots again.

    With autoreset disabled this resets them, to states drawn from `rng` if one is
    given; in the other modes the environment does so by itself.
    """
    result = env.step(actions)
    finished = result[2] | result[3]
    if finished.any() and env.metadata["autoreset_mode"] is AutoresetMode.DISABLED:
        options: dict[str, Any] = {"reset_mask": finished}
        if rng is not None:
            options["state"] = random_states(env, rng)
        env.reset(options=options)
    return result


def pair(
    case: SystemCase, mode: str, num_envs: int = 4, seed: int = 1
) -> list[ControlVectorEnv]:
    """Two environments that have begun alike, with slots that finish soon."""
    envs = [
        case.vector(num_envs, autoreset_mode=mode, max_episode_steps=11, **case.easy)
        for _ in range(2)
    ]
    for env in envs:
        env.reset(seed=seed)
    return envs


def walk(env: ControlVectorEnv, steps: int, seed: int) -> list[StepResult]:
    """What the environment returns on a walk of random actions."""
    rng = np.random.default_rng(seed)
    actions = rng.integers(0, env.single_action_space.n, (steps, env.num_envs))
    return [step_and_reset(env, row) for row in actions]


def assert_walk_alike(ours: ControlVectorEnv, theirs: ControlVectorEnv) -> None:
    """Their states, counters and random streams are the same, to the last bit."""
    for mine, other in zip(walk(ours, 60, 0), walk(theirs, 60, 0), strict=True):
        assert_same_step(mine, other)
