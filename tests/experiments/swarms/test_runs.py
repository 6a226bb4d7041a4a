"""Runs of swarms are those of `acl_gym.swarm`, and what is measured of them is right."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.experiments import methods
from acl_gym.experiments.runner import run_studies
from acl_gym.experiments.swarms import runs
from acl_gym.experiments.swarms.study import (
    POINTS,
    TOPOLOGIES,
    SwarmStudy,
    make_channel,
    recorded_steps,
)
from acl_gym.experiments.thesis import chapter6
from acl_gym.swarm import Everyone, Radius, run
from acl_gym.swarm.aggregation import AggregatingAgents, Field, Quadratic
from acl_gym.swarm.pso import minimize
from acl_gym.swarm.pso.benchmark_functions import sphere


def aggregation(steps: int = 60, **more: Any) -> SwarmStudy:
    channel = more.pop("channel", {})
    stale = more.pop("stale", False)
    return SwarmStudy(
        method="aggregation",
        settings={"agents": 12, "time_step": 0.01, **more},
        channel=channel,
        stale=stale,
        steps=steps,
    )


def particles(**more: Any) -> SwarmStudy:
    settings = {"function": "sphere", "variables": 3, "n_particles": 10, **more}
    return SwarmStudy(method="pso", settings=settings, steps=1_000)


def ants(**channel: Any) -> SwarmStudy:
    settings = {"env": "grid", "ants": 8, "max_steps": 60}
    return SwarmStudy(method="moving-ants", settings=settings, channel=channel, steps=2)


SHORT = [
    aggregation(channel={"loss": 0.3}),
    aggregation(profile="Gaussian", noise=5.0),
    particles(),
    ants(),
]


def test_rows_are_measured_on_the_positions_of_the_framework() -> None:
    study = aggregation(channel={"topology": "radius", "sigma": 1.5})
    found = methods.run(study, 3)
    history = run(
        *(AggregatingAgents(), Field(12, time_step=0.01), 60, 3, Radius(1.5)),
        record=("positions",),
    )
    x = history["positions"]
    assert found.table.tobytes() == x[-1].tobytes()
    assert found.rows["env_steps"].tolist() == [*range(61)]
    for k in (0, 1, 30, 60):
        row, middle = found.rows.iloc[k], x[k].mean(axis=0)
        away = [math.dist(each, middle) for each in x[k]]
        before = x[max(k, 1) - 1].mean(axis=0)
        speed = math.dist(x[max(k, 1)].mean(axis=0), before) / 0.01
        assert row["drift"] == pytest.approx(math.dist(middle, x[0].mean(axis=0)))
        assert row["centre_speed"] == pytest.approx(speed)
        assert row["size"] == pytest.approx(max(away))
        assert row["rms"] == pytest.approx(math.sqrt(sum(d * d for d in away) / 12))
        assert row["parts"] == plain_parts(x[k], runs.PART)


def plain_parts(x: Any, reach: float) -> int:
    """Agents join the group of everyone near them, until nothing changes."""
    group = [*range(len(x))]
    for _ in x:
        for i in range(len(x)):
            for j in range(len(x)):
                if math.dist(x[i], x[j]) < reach:
                    group[i] = group[j] = min(group[i], group[j])
    return len(set(group))


@given(st.integers(1, 12), st.floats(0.05, 2.0), st.integers(0, 1000))
def test_parts(n: int, reach: float, seed: int) -> None:
    x = np.random.default_rng(seed).random((n, 2)) * 3
    assert runs.count_parts(x, reach) == plain_parts(x, reach)


def test_the_letter_of_definition_6_2_and_seeds() -> None:
    letter = methods.run(aggregation(stale=True), 0)
    late = methods.run(aggregation(channel={"delay": 1}), 0)
    split, other = (methods.run(aggregation(), seed) for seed in (0, 1))
    assert letter.table.tobytes() == late.table.tobytes() != split.table.tobytes()
    assert split.table.tobytes() != other.table.tobytes()
    assert split.rows["drift"].max() < 1e-13 < 1e-4 < letter.rows["drift"].max()


def test_a_field_without_noise_is_a_field_and_noise_is_that_of_the_generator() -> None:
    bowl = Quadratic(np.array([1.0, 2.0]))
    fields: list[Any] = [
        Field(5, profile=bowl),
        runs.NoisyField(5, 0.0, profile=bowl),
        runs.NoisyField(5, 3.0, profile=bowl),
    ]
    for each in fields:
        each.reset(np.random.default_rng(0))
    plain, silent, noisy = (each.observe()["slope"] for each in fields)
    assert plain.tobytes() == silent.tobytes()
    rng = np.random.default_rng(0)
    rng.uniform(-3.0, 3.0, (5, 2))
    np.testing.assert_array_equal(noisy, plain + 3.0 * rng.standard_normal((5, 2)))
    assert (fields[2].observe()["slope"] == noisy).all()
    fields[2].step(np.zeros((5, 2)), rng)
    assert (fields[2].observe()["slope"] != noisy).all()
    with pytest.raises(ValueError, match="noise must"):
        runs.NoisyField(5, -1.0)


@pytest.mark.parametrize("profile", sorted(runs.PROFILES))
def test_the_goal_is_where_a_swarm_without_noise_goes(profile: str) -> None:
    study = aggregation(1_500, profile=profile, noise=0.0)
    rows = methods.run(study, 0).rows
    assert rows["centre_miss"].iloc[-1] < 1e-3
    assert rows["miss"].iloc[-1] == pytest.approx(rows["rms"].iloc[-1], abs=1e-3)
    assert (rows["drift"].iloc[-1] > 1.0).all()


def test_particle_swarms_are_those_of_minimize() -> None:
    found = methods.run(particles(), 5)
    plain = minimize(
        *(sphere, [(-100.0, 100.0)] * 3),
        n_particles=10,
        max_evaluations=1_000,
        seed=5,
        topology=Everyone(),
        history=True,
    )
    assert found.table.tolist() == plain.x.tolist()
    assert found.rows["value"].iloc[-1] == plain.fun
    for evaluations, value in zip(
        found.rows["env_steps"], found.rows["value"], strict=True
    ):
        made = max(0, int(evaluations) // 10 - 1)  # whole iterations
        assert value == plain.history["fun"][made]
    assert not found.failure


@pytest.mark.parametrize("channel", [{}, {"delay": 2}, {"topology": "ring"}], ids=str)
def test_a_colony_as_a_swarm_learns_the_same(channel: dict[str, Any]) -> None:
    found = methods.run(ants(**channel), 0)
    row = found.rows.iloc[0]
    assert row["differing"] == 0
    assert row["same_draws"] == 1
    assert 0 < row["learned"] <= row["entries"]
    learned, swarm = found.table.reshape(2, -1)
    assert learned.tobytes() == swarm.tobytes()


def test_another_colony_is_seen_to_differ(monkeypatch: pytest.MonkeyPatch) -> None:
    make, seeds = runs._colony, iter([0, 1])
    monkeypatch.setattr(
        runs, "_colony", lambda name, n, _, options: make(name, n, next(seeds), options)
    )
    row = runs.run_ants(ants(), 0).rows.iloc[0]
    assert row["differing"] > 0
    assert row["same_draws"] == 0


def test_processes_give_the_bits_of_one_and_nothing_is_made_twice(
    tmp_path: Path,
) -> None:
    made = run_studies(SHORT, range(2), tmp_path, workers=2)
    times = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.parquet")}
    assert len(times) == 2 * len(SHORT)
    again = run_studies(SHORT, range(2), tmp_path, workers=1)
    assert times == {path: path.stat().st_mtime_ns for path in times}
    for study in SHORT:
        for seed in range(2):
            here = methods.run(study, seed)
            for there in (made.runs(study)[seed], again.runs(study)[seed]):
                assert there.table.tobytes() == here.table.tobytes()
                measured = here.rows.drop(columns="seconds")
                assert (there.rows[[*measured]] == measured).all(axis=None)


def test_runs_of_swarms_leave_no_policy() -> None:
    with pytest.raises(ValueError, match="runs of pso have no policy"):
        methods.restore_policy(particles(), methods.run(particles(), 0))  # type: ignore[arg-type]


@pytest.mark.parametrize("topology", TOPOLOGIES)
def test_channels_by_name(topology: str) -> None:
    x = np.random.default_rng(0).random((9, 2))
    channel = make_channel(9, topology, sigma=0.5, neighbours=2)
    inbox = channel.deliver({}, x, np.random.default_rng(0))
    distance = np.linalg.norm(x[:, None] - x[None], axis=-1)
    expected = {
        "everyone": np.full(9, 9),
        "nobody": np.zeros(9),
        "ring": np.full(9, 5),
        "von_neumann": np.full(9, 5),
        "radius": (distance < 0.5).sum(axis=1),
        "nearest": np.full(9, 3),
    }
    assert inbox.count.tolist() == expected[topology].tolist()


def test_channels_with_losses_delays_and_radii_of_each_agent() -> None:
    assert repr(make_channel(4, loss=0.2, symmetric=True, delay=3)) == (
        "Delayed(Lossy(Everyone(include_self=True), p=0.2, symmetric=True), steps=3)"
    )
    radii = make_channel(3, "radius", sigma=[1.0, 2.0])
    assert isinstance(radii, Radius)
    assert radii.sigma.tolist() == [1.0, 1.5, 2.0]
    nearest = make_channel(3, "nearest", neighbours=1, include_self=False)
    assert repr(nearest) == "Nearest(1, include_self=False)"
    with pytest.raises(ValueError, match="topology must be one of"):
        make_channel(3, "star")


@pytest.mark.parametrize("steps", [1, 7, POINTS, 2_000, 50_000])
def test_recorded_steps_end_with_the_last(steps: int) -> None:
    found = recorded_steps(steps)
    assert found[0] == 0
    assert found[-1] == steps
    assert found == sorted(set(found))
    assert len(found) == min(steps, POINTS) + 1


def test_studies_say_what_they_are() -> None:
    study = chapter6.aggregation(topology="radius", sigma=2.0)
    assert str(study) == (
        "aggregation, 2,000 steps, topology = radius, sigma = 2.0, agents = 50, "
        "time_step = 0.002"
    )
    assert str(chapter6.LETTER).endswith("Definition 6.2 to the letter")
    keys = [chapter6.aggregation().key, chapter6.LETTER.key, study.key]
    assert len(set(keys)) == 3
    assert study.subject == "field"
    assert particles().subject == "sphere"
    for each in SHORT:
        short = each.brief()
        assert short.kernels == each.kernels
        assert short.steps < each.steps
        assert len(methods.run(short, 0).rows)
