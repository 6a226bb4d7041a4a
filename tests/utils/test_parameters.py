"""Parameters that are declared once."""

from __future__ import annotations

import inspect
import pydoc
import re
from typing import Any

import numpy as np
import pytest

from acl_gym import ACL, Crisp, QLearning
from acl_gym.utils.parameters import Parameter, default_of, parameters_of
from acl_gym.utils.validation import Range

KINDS = (ACL, QLearning)


def entry(kind: type, name: str) -> str:
    """What the docstring says of an argument, on one line."""
    text = inspect.getdoc(kind)
    assert text is not None
    found = re.search(rf"^    {name}: (.*?)(?=^    \w+: |^\S)", text, re.M | re.S)
    assert found, name
    return " ".join(found[1].split())


@pytest.mark.parametrize("kind", KINDS)
def test_docstrings_give_the_declared_ranges(kind: type) -> None:
    declared = parameters_of(kind)
    assert len(declared) >= 4
    for name, parameter in declared.items():
        said = entry(kind, name)
        assert parameter.range.in_words() in said
        assert ("schedule" in said) == parameter.scheduled


@pytest.mark.parametrize("kind", KINDS)
def test_documentation_tools_see_parameters(kind: type) -> None:
    shown = pydoc.render_doc(kind, renderer=pydoc.plaintext)
    for name, parameter in parameters_of(kind).items():
        assert getattr(kind, name) is parameter
        assert inspect.getdoc(parameter) == parameter.__doc__
        assert parameter.__doc__ is not None
        assert parameter.meaning in shown
        assert parameter.range.in_words() in parameter.__doc__


@pytest.mark.parametrize("kind", KINDS)
def test_defaults_are_in_range_and_set_values_are_checked(kind: Any) -> None:
    grid = Crisp([np.arange(3.0)])
    for name, parameter in parameters_of(kind).items():
        assert parameter.default in parameter.range
        assert parameter.default == default_of(kind, name)
        agent = kind(None, grid, n_actions=2)
        assert getattr(agent, name) == parameter.default
        bad, words = (-1, "be at least") if parameter.whole else (-1.0, "lie in")
        with pytest.raises(ValueError, match=f"{name} must {words}"):
            kind(None, grid, n_actions=2, **{name: bad})


def test_a_fixed_parameter_is_set_once() -> None:
    class Holder:
        size = Parameter("A size", unit="m", fixed=True, above=0)

    holder = Holder()
    with pytest.raises(ValueError, match="size must lie in"):
        holder.size = 0
    holder.size = 2
    with pytest.raises(AttributeError, match=r"make a new agent with size=3"):
        holder.size = 3
    assert holder.size == 2.0
    assert Holder.size.__doc__ == (
        "A size; a number > 0, in m, fixed once the agent is made."
    )
    assert Holder.size.default is None


def test_ranges_in_words() -> None:
    assert Range(at_least=0, below=1).in_words() == "in [0, 1)"
    assert Range(above=0).in_words() == "> 0"
    assert Range(at_least=-1).in_words() == ">= -1"
    assert Range(at_least=1, at_most=2_000_000_000).in_words() == "in [1, 2e9]"
    assert Range().in_words() == "in (-inf, inf)"
    assert 0.0 in Range(at_least=0)
    assert np.inf not in Range()
