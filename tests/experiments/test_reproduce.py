"""The experiments of the reproduction, summed up and drawn on results made by formula."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from acl_gym.experiments import outcome, plots, reproduce
from acl_gym.experiments.study import Experiment
from tests.experiments.synthetic import make_results

DRAWN = list(
    {
        (each.plots, next(iter(each.studies.values())).subject): each
        for each in reproduce.EXPERIMENTS
    }.values()
)
"""One experiment for each figure of each system."""


@pytest.mark.parametrize("experiment", DRAWN, ids=lambda each: each.name)
def test_every_figure_of_every_system_is_drawn(
    experiment: Experiment[Any], tmp_path: Path
) -> None:
    plots.save(experiment, make_results(experiment, 2), tmp_path, ("svg",))
    assert "<svg" in (tmp_path / f"{experiment.name}.svg").read_text()[:1000]


@pytest.mark.parametrize(
    "experiment",
    [each for each in reproduce.EXPERIMENTS if each.table or each in DRAWN],
    ids=lambda each: each.name,
)
def test_every_kind_of_summary_is_json(experiment: Experiment[Any]) -> None:
    found = outcome.summary(experiment, make_results(experiment, 2))
    read = json.loads(json.dumps(found, allow_nan=False))
    assert read["name"] == experiment.name
    assert len(read["studies"]) == len(experiment.everything)
    assert bool(read["table"]) == bool(experiment.table)


def test_names_are_chosen_in_the_order_of_the_thesis() -> None:
    names = [each.name for each in reproduce.chosen(["fig5.4", "fig3.9", "fig5.4"])]
    assert names == ["fig3.9", "fig5.4"]
    assert reproduce.chosen(["all"]) == list(reproduce.EXPERIMENTS)
    claims = reproduce.chosen(["claims"])
    assert all(each.claims or each.explains for each in claims)
    assert {"fig5.4", "row-choices"} <= {each.name for each in claims}
    with pytest.raises(
        ValueError, match=r"must be one of 'all', 'claims', .*, got 'x'"
    ):
        reproduce.chosen(["fig5.4", "x"])
    with pytest.raises(ValueError, match=r"got 'fig3.66'\. Did you mean 'fig3.6'\?$"):
        reproduce.chosen(["fig3.66"])


def test_a_report_needs_results(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"there is no results\.json in"):
        reproduce.write_pages(tmp_path)
    for content in ("{", "[]", "{}", '{"claims": []}'):
        (tmp_path / "results.json").write_text(content)
        with pytest.raises(ValueError, match="is not the result of a reproduction"):
            reproduce.write_pages(tmp_path)


def test_a_table_of_all_rows(tmp_path: Path) -> None:
    import pandas as pd

    (experiment,) = reproduce.chosen(["fig3.9"])
    path = tmp_path / "results.parquet"
    reproduce._write_rows(path, [experiment], make_results(experiment, 2))
    frame = pd.read_parquet(path)
    assert set(frame["study"]) == {f"fig3.9: M = {ants}" for ants in (1, 5, 9)}
    assert {"seed", "env_steps", "policy_cost", "success_rate"} <= set(frame.columns)
