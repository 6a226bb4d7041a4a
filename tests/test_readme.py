"""The README's Python runs as printed and does what its comments promise."""

from __future__ import annotations

import json
import os
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import acl_gym
from acl_gym.cli.app import app

README = Path(__file__).resolve().parents[1] / "README.md"
PAGES = [f"docs/{path.name}" for path in sorted((README.parent / "docs").glob("*.md"))]
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)


COMMANDS = re.findall(r"^acl-gym .*?(?=\s+#|$)", README.read_text(), re.MULTILINE)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the examples write goes into an empty folder."""
    monkeypatch.chdir(tmp_path)


def run(*blocks: str) -> dict[str, Any]:
    """The names that are defined once these blocks have run, one after the other."""
    names: dict[str, Any] = {"__name__": "readme"}
    for block in blocks:
        exec(compile(block, str(README), "exec"), names)
    return names


def shell(command: str) -> str:
    """What a command prints; it must succeed.

    It runs in this process: the tests of the command line start it as a shell does.
    """
    program, *arguments = shlex.split(command)
    done = CliRunner().invoke(app, arguments, prog_name=program)
    assert done.exit_code == 0, f"{command}: {done.output}"
    return done.stdout


def test_ten_lines_learn_the_pendulum_and_go_home(
    capsys: pytest.CaptureFixture[str],
) -> None:
    run(*BLOCKS[:2])
    cost = float(capsys.readouterr().out.split()[0])
    assert cost < 1.2 * 38.4, "five seeds: 41.1 to 44.0"
    written = {"swing_up.npz", "policy.png", "swing_up.h", "swing_up_policy.npz"}
    assert set(os.listdir()) == written


def test_a_plant_of_ones_own_is_controlled(capsys: pytest.CaptureFixture[str]) -> None:
    """Seed 0 has 53.8, and all starts succeed; 52 is about the best."""
    names = run(BLOCKS[2])
    assert 50.0 < float(capsys.readouterr().out) < 55.0
    result = acl_gym.evaluate_policy_cost(names["colony"], names["env"])
    assert result.success_rate == 1.0
    assert Path("rod.h").is_file()


def test_a_plant_without_equations_is_controlled(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """All of 20 runs were within 25% of the optimum."""
    run(BLOCKS[3])
    said, cost = capsys.readouterr().out.splitlines()
    assert said.startswith("LearnedDynamics(gaussian process")
    assert float(cost) < 1.25 * 38.4
    assert Path("policy.h").is_file()


def test_a_newcomers_environment_is_learned() -> None:
    """Five seeds take 15.2 to 15.3 steps, and all arrive."""
    result = run(BLOCKS[4])["result"]
    assert result.success_rate >= 0.95
    assert result.cost < 16.0


@pytest.mark.slow
def test_commands_of_the_shell_do_what_they_say() -> None:
    commands = [
        one for one in COMMANDS if one.split()[1] in ("envs", "train", "evaluate")
    ]
    listed, *rest = commands
    assert "acl_gym/Pendulum-v0" in shell(listed)
    said = [json.loads(shell(f"{command} --json")) for command in rest]
    trained, evaluated, resumed, filmed, continuous, thesis, balanced = said
    # Seed 0: 42.8 after 8,991 interactions.
    assert trained["agent"] == "returning"
    assert trained["policy_cost"] < 46.0
    assert trained["env_steps"] < 9_500
    assert evaluated["policy_cost"] == trained["policy_cost"]
    assert resumed["trials"] == 60
    assert resumed["best"]["policy_cost"] == filmed["policy_cost"] < 46.0
    assert Path("swing_up.gif").stat().st_size > 0
    assert continuous["trials"] == 5
    assert thesis["agent"] == balanced["agent"] == "acl"
    assert thesis["policy_cost"] < 1.35 * 38.4
    # The README states 500, 491 and 500 with three seeds.
    assert balanced["best"]["policy_return"] > 450.0


@pytest.mark.usefixtures("short_runs")
def test_the_reproduction_runs_from_the_shell() -> None:
    for command in COMMANDS:
        if "reproduce" in command or "report" in command:
            shell(command)
    claims = Path("results/fig5.4/claims.md").read_text()
    assert "| C14 |" in claims, "what the figure decides"
    assert Path("results/fig5.4/report.html").is_file()


@pytest.mark.skipif(not PAGES, reason="a source distribution has no documentation")
@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md", *PAGES])
def test_links_within_the_project_lead_somewhere(page: str) -> None:
    source = README.parent / page
    assert "@@" not in source.read_text(), "a figure is to be filled in"
    links = re.findall(r"\]\(([^)#]+)\)", source.read_text())
    for link in links:
        # Pages of environments are written when the site is built.
        if not link.startswith(("http:", "https:", "environments/generated/")):
            assert (source.parent / link).is_file(), f"{page} links to {link}"
