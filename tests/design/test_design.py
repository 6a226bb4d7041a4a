"""The whole way from a plant to a folder, and the page in it."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import acl_gym
from acl_gym.design import Design, design
from acl_gym.design.learning import Learned, Progress, learn
from acl_gym.design.run import draw_starts

CHROMIUM = next(
    filter(Path.exists, map(Path, ("/usr/bin/chromium", "/usr/bin/chromium-browser"))),
    None,
)
FILES = {"policy.h", "policy.npz", "summary.json", "report.html"}
FILES |= {"policy.png", "trajectories.png", "starts.png", "learning.png"}
STEPS = 2_500  # with which the double integrator is learned, in less than a second


def integrator(x: Any, u: Any) -> Any:
    return [x[1], u[0]]


def plant(**changes: Any) -> Any:
    """Bring a mass to rest at 0; 4 s."""
    settings: dict[str, Any] = {
        "dynamics": integrator,
        "low": [-1.0, -1.0],
        "high": [1.0, 1.0],
        "inputs": [-1.0, 0.0, 1.0],
        "sampling_time": 0.1,
        "goal": [0.0, 0.0],
        "tolerance": [0.2, 0.2],
        "cost": ([1.0, 0.1], 0.01),
        "max_episode_steps": 40,
        "state_names": ["place, m", "speed, m/s"],
        "input_names": ["force, N"],
        "num_envs": 1,
        **changes,
    }
    return acl_gym.plant(settings.pop("dynamics"), **settings)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Design:
    return design(plant(), tmp_path_factory.mktemp("design"), seed=3, steps=STEPS)


def test_the_folder_has_all_of_it(made: Design) -> None:
    assert {file.name for file in made.folder.iterdir()} == FILES
    assert made.succeeded
    assert made.advice == ()
    summary = json.loads((made.folder / "summary.json").read_text())
    assert summary["success_rate"] == made.measures.success_rate
    assert summary["cost"] == made.measures.cost.mean
    assert summary["reaches_goal"] is True
    assert summary["seed"] == 3
    assert summary["interactions"] >= max(STEPS, summary["interactions_of_best"])
    assert summary["seconds"] > summary["learning_seconds"] > 0.0
    assert summary["uncertain"] is None
    assert summary["worst_start"] == list(made.measures.worst_start)
    assert summary["made"]["acl-gym"] == acl_gym.__version__
    for name in ("settling_time", "overshoot", "time_to_goal", "command", "advice"):
        assert name in summary


def test_the_figures_are_those_of_starts_that_chose_nothing(made: Design) -> None:
    """Evaluated again from other random starts, the cost is the same but for chance."""
    env = plant()
    starts = env.system.sample_states(np.random.default_rng(99), 1_000).T
    found = acl_gym.evaluate_policy_cost(made.policy, env, starts)
    # The standard deviation of a mean over 1,000 starts is 3% of the cost's own.
    spread = found.costs.std() / np.sqrt(1_000)
    assert made.measures.cost.mean == pytest.approx(found.cost, abs=5.0 * spread)
    assert made.measures.starts == 1_000


def test_the_same_seed_and_steps_give_the_same_controller(
    made: Design, tmp_path: Path
) -> None:
    steps = made.learned.interactions
    again = design(plant(), tmp_path / "again", seed=3, steps=steps)
    for name in ("policy.h", "policy.npz"):
        assert (again.folder / name).read_bytes() == (made.folder / name).read_bytes()
    assert again.measures == made.measures
    assert f"seed=3, steps={steps}" in again.summary["command"]


def test_the_controller_for_numpy_is_that_of_the_policy(
    made: Design, tmp_path: Path
) -> None:
    exported = made.policy.to_numpy(tmp_path / "policy.npz")
    assert exported.read_bytes() == (made.folder / "policy.npz").read_bytes()


class Page(HTMLParser):
    """Collects what a page would load, and checks that tags are closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loaded: list[str] = []
        self.images = 0
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        if tag not in ("meta", "link", "img", "br"):
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href") and not value.startswith("data:"):
                self.loaded.append(value)
        self.images += tag == "img"

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_holds_everything_and_loads_nothing(made: Design) -> None:
    text = (made.folder / "report.html").read_text()
    page = Page(text)
    assert (page.open, page.loaded, page.images) == ([], [], 4)
    for words in (
        f"from {100 * made.measures.success_rate:g}% of 1,000 random starts",
        "place, m",
        "force, N: -1, 0, 1",
        "settling time, s",
        "Overshoot",
        "policy_INVALID",
        f"steps={made.learned.interactions}",
    ):
        assert words in text, words
    assert "What to try" not in text


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (apt install chromium)")
def test_the_page_in_a_browser(made: Design) -> None:
    sync = pytest.importorskip("playwright.sync_api")
    wrong: list[str] = []
    with sync.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"]
        )
        tab = browser.new_page()
        tab.on("pageerror", lambda error: wrong.append(str(error)))
        tab.on("console", lambda message: wrong.append(message.text))
        tab.goto((made.folder / "report.html").as_uri())
        for width in (1280, 390):
            tab.set_viewport_size({"width": width, "height": 800})
            assert tab.evaluate("document.documentElement.scrollWidth") <= width
        widths = tab.evaluate("[...document.images].map(i => i.naturalWidth)")
        browser.close()
    assert all(widths)
    assert wrong == []


def test_a_goal_out_of_reach_is_said_with_what_to_try(tmp_path: Path) -> None:
    weak = plant(inputs=[-0.01, 0.01], state_names=["<b>place</b>, m", "speed, m/s"])
    made = design(weak, tmp_path / "weak", steps=1_000)
    assert not made.succeeded
    assert made.advice
    text = (made.folder / "report.html").read_text()
    assert "What to try" in text
    assert "Make the inputs stronger" in text
    assert "&lt;b&gt;place&lt;/b&gt;" in text  # names come from anywhere
    assert Page(text).open == []
    assert json.loads((made.folder / "summary.json").read_text())["advice"]


@pytest.mark.parametrize(("slots", "ants"), [(None, 5), (1, 5), (3, 3)])
def test_the_ants_are_as_many_as_the_plant_says(
    tmp_path: Path, slots: int | None, ants: int
) -> None:
    made = design(plant(num_envs=slots), tmp_path / "ants", steps=300)
    assert made.learned.ants == made.summary["ants"] == ants
    page = (made.folder / "report.html").read_text()
    assert f"A colony of {ants} ants" in page


def test_over_uncertain_parameters(tmp_path: Path) -> None:
    env = plant(
        dynamics=lambda x, u, p: [x[1], u[0] / p.mass],
        uncertain={"mass": (0.8, 1.25)},
        parameters={"mass": 1.0},
    )
    made = design(env, tmp_path / "out", steps=STEPS)
    found = made.summary["uncertain"]
    assert found["ranges"] == {"mass": [0.8, 1.25]}
    assert found["worst_cost"] >= found["median_cost"]
    assert found["worst_cost"] >= found["nominal_cost"]
    assert 0.8 <= found["worst_parameters"]["mass"] <= 1.25
    assert "mass" in (made.folder / "report.html").read_text()
    # The random starts are those of the nominal plant, without the parameter.
    assert len(made.measures.worst_start) == 2


def test_more_than_two_variables_are_drawn_in_slices(tmp_path: Path) -> None:
    env = plant(
        dynamics=lambda x, u: [x[1], x[2], u[0] - x[2]],
        low=[-1.0] * 3,
        high=[1.0] * 3,
        goal=[0.0] * 3,
        tolerance=[0.3] * 3,
        cost="time",
        state_names=None,
    )
    made = design(env, tmp_path / "out", steps=1_000)
    assert "cells" in made.summary["controller"]["partition"]
    assert (made.folder / "policy.png").stat().st_size > 10_000


def test_one_variable(tmp_path: Path) -> None:
    env = acl_gym.plant(
        lambda x, u: [u[0]],
        low=[-1.0],
        high=[1.0],
        inputs=[-1.0, 1.0],
        sampling_time=0.1,
        goal=[0.0],
        tolerance=[0.06],
        max_episode_steps=20,
    )
    made = design(env, tmp_path / "out", steps=1_000)
    assert made.succeeded


def run(**limits: Any) -> tuple[Learned, list[Progress]]:
    """Learn the double integrator; returns what was told as well."""
    env, told = plant(), []
    settings = {"seed": 0, "seconds": None, "steps": None, "stop": lambda: False}
    states = draw_starts(env.system, 50, 0, 1)
    found = learn(env, states, tell=told.append, **{**settings, **limits})
    assert tuple(told) == found.rows
    return found, told


def test_learning_ends_by_itself() -> None:
    found, told = run()
    assert found.ended == "converged"
    assert told[-1].best.success_rate >= 0.95
    assert found.interactions >= 10_000


def test_learning_stops_when_asked_or_when_the_time_is_up() -> None:
    asked = iter([False, False, True])
    found, _ = run(stop=lambda: next(asked))
    assert found.ended == "interrupted"
    found, told = run(seconds=1e-9)
    assert found.ended == "time"
    assert len(told) == 1
    found, _ = run(steps=1)
    assert found.ended == "steps"


def test_an_interrupted_trial_keeps_the_best_before_it() -> None:
    def interrupt() -> bool:
        if next(asked):
            raise KeyboardInterrupt
        return False

    asked = iter([False] * 30 + [True])  # 30 trials are more than 1,000 interactions
    found, told = run(stop=interrupt)
    assert found.ended == "interrupted"
    assert told
    asked = iter([True])
    with pytest.raises(KeyboardInterrupt):
        run(stop=interrupt)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"seed": -1}, ValueError, "seed must be at least 0, got -1"),
        ({"seconds": 0}, ValueError, "seconds must lie in (0, inf), got 0"),
        ({"steps": 0}, ValueError, "steps must be at least 1, got 0"),
        ({"out": "there/is/none"}, FileNotFoundError, "there is no folder there/is"),
        ({"plant": 3}, TypeError, "got 3"),
    ],
)
def test_bad_arguments(
    arguments: dict[str, Any], error: type[Exception], message: str, tmp_path: Path
) -> None:
    given = {"plant": plant(), "out": tmp_path / "out", **arguments}
    with pytest.raises(error, match=re.escape(message)):
        design(given.pop("plant"), given.pop("out"), **given)
    assert not (tmp_path / "out").exists()


def test_a_file_in_place_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(NotADirectoryError, match="is a file"):
        design(plant(), tmp_path / "out")
    assert (tmp_path / "out").read_text() == "mine"
