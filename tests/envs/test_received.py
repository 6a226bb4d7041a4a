from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from acl_gym.envs import received


@pytest.mark.parametrize(
    "kind", ["float16", "float32", ">f8", ">f4", "longdouble", "int8"]
)
def test_rewards_of_any_real_type_are_taken(kind: str) -> None:
    given = np.array([-1, 0, 2]).astype(kind)
    for form in (given, given[:, None]):
        taken = received.rewards(form, 3)
        assert taken.tolist() == [-1.0, 0.0, 2.0]
        assert taken.dtype == np.float64


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (np.ones(2), r"rewards must have shape \(3,\).* got shape \(2,\)"),
        (np.ones((3, 2)), r"rewards must have shape \(3,\)"),
        (np.float64(1), r"rewards must have shape \(3,\).* got shape \(\)"),
        (np.ones(3) * 1j, r"rewards must be real numbers.* got dtype complex128"),
        (["a", "b", "c"], r"rewards must be real numbers"),
        ([[1], [1, 2], []], r"rewards must be real numbers.* got \[\[1\]"),
        (None, r"rewards must be real numbers"),
        (
            np.ma.masked_array([1.0, 2, 3], [True, False, False]),
            r"rewards must be real",
        ),
    ],
)
def test_other_rewards_are_refused(given: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        received.rewards(given, 3)


def test_flags_are_bools_or_0_and_1() -> None:
    assert received.flags("terminated", [0, 1, 0], 3).tolist() == [False, True, False]
    assert received.flags("truncated", np.array([[1.0], [0.0]]), 2).tolist() == [
        True,
        False,
    ]
    for wrong, message in (
        (np.ones(1, bool), r"terminated must have shape \(3,\)"),
        ([0.0, np.nan, 1.0], r"True or False for each slot, got nan in slot 1"),
        ([0, 1, 2], r"got 2 in slot 2"),
        ([None, None, None], r"terminated must be bools"),
    ):
        with pytest.raises(ValueError, match=message):
            received.flags("terminated", wrong, 3)


def test_observations_have_a_row_for_each_slot() -> None:
    seen = received.observations({"a": np.ones((2, 3), np.float16), "b": [1, 2]}, 2)
    assert seen["a"].dtype == np.float32  # kernels are not compiled for float16
    assert seen["b"].tolist() == [1, 2]
    swapped = received.observations(np.array([[1.0, 2.0]]).astype(">f8"), 1)
    assert swapped.dtype.isnative
    assert swapped.tolist() == [[1.0, 2.0]]
    with pytest.raises(ValueError, match=r"one row for each of the 2 slots, got shape"):
        received.observations(np.ones((1, 3)), 2)
    with pytest.raises(ValueError, match=r"observations\['b'\] must have one row"):
        received.observations({"b": 1.0}, 2)


@pytest.mark.parametrize(
    "mask", [np.eye(2, dtype=bool), np.eye(2), np.eye(2, dtype=">i4"), [[1, 0], [0, 1]]]
)
def test_masks_hold_0_and_1(mask: Any) -> None:
    allowed = received.action_mask({"action_mask": mask}, 2, 2)
    assert allowed is not None
    assert allowed.tolist() == [[True, False], [False, True]]


@pytest.mark.parametrize(
    ("mask", "message"),
    [
        (np.full((2, 2), np.nan), r"got \[nan, nan\] in slot 0"),
        # Logits: 0 means allowed there, the opposite of a mask.
        (np.array([[0.0, -np.inf], [0.0, 0.0]]), r"got \[0.0, -inf\] in slot 0"),
        (np.ones((2, 3)), r"must have shape \(2, 2\)"),
        (np.ones(2), r"must have shape \(2, 2\)"),
        (
            np.ma.masked_array(np.eye(2, dtype=bool), np.eye(2, dtype=bool)),
            r"must have shape \(2, 2\).* got masked_array",
        ),
        ("text", r"must have shape \(2, 2\)"),
        (np.ones((2, 2)) * 1j, r"bools or 0 and 1, got complex128"),
    ],
)
def test_other_masks_are_refused(mask: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        received.action_mask({"action_mask": mask}, 2, 2)


def test_a_list_of_infos_means_the_same_as_a_dict() -> None:
    rows = [{"action_mask": [1, 0], "other": 1}, {}]
    allowed = received.action_mask(received.infos(rows, 2), 2, 2)
    assert allowed is not None
    assert allowed.tolist() == [[True, False], [True, True]]
    last = [{"final_obs": [3.0], "final_info": {"action_mask": [0, 1]}}, {}]
    found = received.infos(last, 2)
    assert found["final_obs"][0] == [3.0]
    inner = received.action_mask(found["final_info"], 2, 2)
    assert inner is not None
    assert inner.tolist() == [[False, True], [True, True]]
    assert received.infos(None, 2) == {}


@pytest.mark.parametrize("infos", [[{}], "ab", 3, [{}, 1]])
def test_other_infos_are_refused(infos: Any) -> None:
    with pytest.raises(
        ValueError, match=r"infos must be a dict of arrays, or a list of 2"
    ):
        received.infos(infos, 2)


class _Env:
    def __init__(self, metadata: Any) -> None:
        self.metadata = metadata


def test_the_mode_may_be_text() -> None:
    for mode in AutoresetMode:
        for given in (mode, mode.value):
            assert received.autoreset_mode_of(_Env({"autoreset_mode": given})) is mode
    assert received.autoreset_mode_of(_Env({})) is AutoresetMode.NEXT_STEP
    with pytest.raises(ValueError, match=r"autoreset_mode'\] must be.* got 'soon'"):
        received.autoreset_mode_of(_Env({"autoreset_mode": "soon"}))


def test_a_step_has_five_parts() -> None:
    with pytest.raises(ValueError, match=r"env.step must return 5 parts"):
        received.parts("step", (1, 2, 3, 4), 5)
