"""What the ant agents say of what they cannot use, and of trials without a solution."""

from __future__ import annotations

import os
import re
import warnings
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import AntColonySystem, AntSystem, Crisp, MaxMinAntSystem
from acl_gym.agents.ant_system import NoSolutionWarning
from acl_gym.envs.graph import TravellingSalesmanInstance, read_tour, read_tsplib
from tests.agents.reference_colony import chains

KINDS: list[type[Any]] = [AntSystem, AntColonySystem, MaxMinAntSystem]
SALESMAN = "acl_gym/TravellingSalesman-v0"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("env_id", ["acl_gym/Pendulum-v0", "CartPole-v1"])
def test_states_on_a_scale_are_for_other_agents(kind: type[Any], env_id: str) -> None:
    env = gym.make_vec(env_id, num_envs=2)
    words = rf"{kind.__name__} needs states that are cells.* got Box.*take ReturningACL"
    with pytest.raises(ValueError, match=words):
        kind(env)
    cells = Crisp.from_box(
        gym.spaces.Box(-1.0, 1.0, env.single_observation_space.shape), 3
    )
    assert kind(env, cells).n_actions == env.single_action_space.n


def test_how_many_ants_are_usual_for_what() -> None:
    for kind in KINDS:
        for wrong in (1, -3, 0):
            with pytest.raises(ValueError, match="n_cities must be at least 2"):
                kind.usual_ants(wrong)
        for wrong in ("att48", 48.0, True, None):
            with pytest.raises(TypeError, match="n_cities must be an integer"):
                kind.usual_ants(wrong)
        with pytest.raises(ValueError, match="local_search must be one of"):
            kind.usual_ants(48, "4-opt")


@pytest.mark.parametrize("make", [gym.make, gym.make_vec])
@pytest.mark.parametrize(
    ("env_id", "wrong", "words"),
    [
        (SALESMAN, "distance", "TravellingSalesman has no parameter 'distance'; choose "
         "from instance, .* Did you mean 'distances'"),
        (SALESMAN, "ants", "TravellingSalesman has no parameter 'ants'"),
        ("acl_gym/DoubleBridge-v0", "length", "DoubleBridge has no parameter 'length'; "
         "choose from lengths, .* Did you mean 'lengths'"),
        ("acl_gym/Pendulum-v0", "torque", ".*no parameter 'torque'.* mean 'torques'"),
    ],
)  # fmt: skip
def test_a_keyword_that_no_system_has(
    make: Any, env_id: str, wrong: str, words: str
) -> None:
    with pytest.raises(TypeError, match=words):
        make(env_id, **{wrong: 1})


@pytest.mark.parametrize("read", [read_tsplib, read_tour])
def test_a_file_that_cannot_be_read(read: Any, tmp_path: Path) -> None:
    missing = tmp_path / "no.tsp"
    words = (
        rf"path must be a file of TSPLIB .*{re.escape(str(missing))!s}.*No such file"
    )
    with pytest.raises(FileNotFoundError, match=words):
        read(missing)
    with pytest.raises(FileNotFoundError, match=re.escape(os.getcwd())):
        read("no_such.tsp")
    with pytest.raises(ValueError, match="path must be a file, got"):
        read(tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(NotADirectoryError, match="path must be a file of TSPLIB"):
        read(tmp_path / "file" / "no.tsp")


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0,
    reason="the superuser may read everything, and Windows has other permissions",
)
def test_a_file_that_may_not_be_read(tmp_path: Path) -> None:
    file = tmp_path / "mine.tsp"
    file.write_text("TYPE: TSP")
    file.chmod(0)
    with pytest.raises(PermissionError, match="path must be a file of TSPLIB"):
        read_tsplib(file)


def test_the_environment_says_so_too(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="path must be a file of TSPLIB"):
        gym.make_vec(SALESMAN, tsplib=tmp_path / "no.tsp")


@pytest.mark.parametrize("name", ["instance", "distances", "coordinates", "tsplib"])
def test_a_graph_is_made_an_instance_first(name: str) -> None:
    networkx = pytest.importorskip("networkx")
    graph = networkx.complete_graph(4)
    with pytest.raises(TypeError, match=rf"{name} must .*Instance\.from_networkx\(gr"):
        gym.make_vec(SALESMAN, **{name: graph})
    words = r"the 'weight' of edge \(0, 1\) must .*it has none; .*weight=\.\.\."
    with pytest.raises(TypeError, match=words):
        TravellingSalesmanInstance.from_networkx(graph)


@pytest.mark.parametrize("value", [48, np.ones((3, 3)), [[0, 1], [1, 0]]])
def test_what_is_no_instance(value: Any) -> None:
    with pytest.raises(ValueError, match=r"instance must be one of .*pass a matrix"):
        gym.make_vec(SALESMAN, instance=value)


@pytest.mark.parametrize("kind", KINDS)
def test_one_warning_where_no_ant_arrives(kind: type[Any]) -> None:
    """One step leads only the ants next to the goal there; of three ants none is."""
    cells = Crisp([np.arange(50.0)])
    colony = kind(chains(3, length=50), cells, max_steps=1, seed=0)
    with pytest.warns(NoSolutionWarning) as given:
        colony.learn(trials=4)
    assert len(given) == 1
    assert "in 4 trials none of 3 ants has come to a terminal state within 1 steps" in (
        str(given[0].message)
    )
    assert given[0].filename == __file__


@pytest.mark.parametrize("kind", KINDS)
def test_no_warning_where_an_ant_arrives(kind: type[Any]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        colony = kind(chains(3, length=4), Crisp([np.arange(4.0)]), seed=0)
        colony.learn(trials=2)
        colony.learn(total_timesteps=1)
        kind(gym.make_vec(SALESMAN, num_envs=2), seed=0).learn(trials=1)
