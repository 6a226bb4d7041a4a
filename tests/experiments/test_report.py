"""What experiments found, as JSON and as a page with figures and curves beside it."""

from __future__ import annotations

import base64
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from jinja2 import UndefinedError

from acl_gym.experiments import outcome, report
from acl_gym.experiments.claims import Claim, Part
from acl_gym.experiments.outcome import POINTS, Outcome
from acl_gym.experiments.results import Results
from acl_gym.experiments.study import Experiment
from tests.browser import chromium, needs_chromium, new_tab
from tests.experiments.synthetic import (
    TRIALS,
    make_experiment,
    make_results,
    pendulums,
)

# A grey pixel.
PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNoAAAAggCBd81ytgAAAABJRU5"
    "ErkJggg=="
)
VOID = {"meta", "link", "img", "br", "input"}


class Page(HTMLParser):
    """A page as a reader meets it; refuses tags that do not match."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("style", "script"):
            self.text += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


def found(experiment: Experiment, results: Results) -> Outcome:
    """A summary, with a table as `tables` makes them, through JSON."""
    summed = outcome.summary(experiment, results, "Trials")
    summed["table"] = {
        "headings": ["Method", "last\ncost"],
        "rows": [["ACL", "44.0\n42.0–48.0"], ["DQN", "46.0"]],
        "best": [[0, 1]],
        "comparisons": [
            {
                **{"where": "here", "measure": "cost", "method": "ACL", "rival": "DQN"},
                **{"verdict": "wins", "ratio": 0.9, "low": 0.8, "high": None},
            }
        ],
    }
    return dict(json.loads(json.dumps(summed, allow_nan=False)))


@pytest.fixture
def summed() -> Outcome:
    experiment = make_experiment(pendulums(), "race")
    return found(experiment, make_results(experiment))


CLAIM = {
    **Claim("C1", "A claim.", "§3", lambda _: [Part("it is <so>", "1", True)]).judge(
        Results({})
    ),
    "experiments": ["trial", "elsewhere"],
    "trials": [],
}


def write(folder: Path, *experiments: Outcome, **options: Any) -> str:
    for each in experiments:
        for figure in each["figures"]:
            (folder / f"{figure['file']}.png").write_bytes(PNG)
    path = folder / "report.html"
    report.write_report(
        path,
        **{
            "title": "A report",
            "experiments": experiments,
            "figures": folder,
            "command": "acl-gym reproduce all",
            "made": {"cpu": "a CPU", "runs, date": ["2026-01-01", "2026-01-02"]},
            "facts": "3 runs",
            "notes": ["How it was done."],
            **options,
        },
    )
    return path.read_text()


class TestSummary:
    def test_holds_costs_and_curves(self, summed: Outcome) -> None:
        studies = {each["label"]: each for each in summed["studies"]}
        assert list(studies) == [*pendulums(), "J*"]
        study = studies["ACL, fuzzy"]
        assert study["runs"] == 3
        assert study["last"]["min"] < study["last"]["interquartile_mean"]
        assert study["parameters"] == str(pendulums()["ACL, fuzzy"])
        for curve in study["curves"].values():
            assert len(curve["mean"]) == TRIALS
            lines = (curve[name] for name in ("low", "mean", "high"))
            for low, mean, high in zip(*lines, strict=True):
                assert low <= mean * (1 + 1e-4) <= high * (1 + 2e-4)
        assert studies["J*"]["last"]["low"] is None

    def test_long_curves_are_thinned(self) -> None:
        study = pendulums()["ACL, fuzzy"]
        experiment = make_experiment({"long": study}, "bands")
        results = make_results(experiment, long=[range(1, 1001), range(2, 1002)])
        (long, _) = outcome.summary(experiment, results)["studies"]
        assert long["every"] == 4
        assert len(long["curves"]["policy_cost"]["mean"]) == POINTS

    def test_without_curves(self, summed: Outcome) -> None:
        short = outcome.without_curves({"experiments": [summed], "runs": 3})
        assert short["runs"] == 3
        assert "curves" not in short["experiments"][0]["studies"][0]
        assert "curves" in summed["studies"][0]


def test_the_page_holds_everything(tmp_path: Path, summed: Outcome) -> None:
    text = write(tmp_path, summed, claims=[CLAIM])
    page = Page(text)
    shown = " ".join(page.text.split())
    for part in (
        *(
            "A report",
            "3 runs",
            "How it was done.",
            "What is tried.",
        ),
        *("acl-gym reproduce all", "a CPU", "2026-01-01, 2026-01-02", "Trials"),
        *("A claim.", "1 holds", *pendulums(), "44.0", "42.0–48.0"),
        *("wins", "0.9 [0.8, ∞]", "epsilon = 0.1"),
    ):
        assert part in shown, part
    assert "None" not in shown
    assert "prefers-color-scheme: dark" in text
    assert len(page.all("h1")) == 1
    assert {"lang": "en"} in page.all("html")
    (image,) = page.all("img")
    assert str(image["alt"]).startswith("A trial, rho = 0.1. ")
    assert (image["src"], image["loading"]) == ("trial.png", "lazy")
    assert (image["width"], image["height"]) == ("1", "1")
    (best,) = [cell for cell in page.all("td") if cell.get("class") == "best"]
    assert best["data-heading"] == "last, cost"
    assert all(cell["scope"] in ("col", "row") for cell in page.all("th"))


def test_the_page_loads_files_beside_it_and_its_links_lead_somewhere(
    tmp_path: Path, summed: Outcome
) -> None:
    summed["claims"] = ["C1"]
    text = write(tmp_path, summed, claims=[CLAIM])
    page = Page(text)
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text)
    loaded = [a[k] for _, a in page.tags for k in ("src", "data-curves") if k in a]
    assert loaded == ["trial.png", "curves/trial.js"]
    assert all((tmp_path / str(file)).is_file() for file in loaded)
    ids = [str(a["id"]) for _, a in page.tags if "id" in a]
    assert len(ids) == len(set(ids))
    links = {str(a["href"]) for a in page.all("a")}
    within = {link[1:] for link in links if link.startswith("#")}
    assert within == {"C1", "claims", "content", "how", "repeat", "trial"}, (
        "what was not run has no link"
    )
    assert within <= set(ids)
    assert links - {f"#{link}" for link in within} == {"trial.png"}


def test_curves_stand_in_a_script_of_their_own(tmp_path: Path, summed: Outcome) -> None:
    text = write(tmp_path, summed)
    script = (tmp_path / "curves" / "trial.js").read_text()
    name, studies = json.loads(f"[{script.removeprefix('showCurves(')[:-3]}]")
    assert name == "trial"
    curves = {study["label"]: study["curves"] for study in summed["studies"]}
    assert {study["label"]: study["curves"] for study in studies} == curves
    assert "setting" not in studies[0], "only what is drawn"
    assert str(summed["studies"][0]["curves"]["policy_cost"]["mean"][0]) not in text


def test_figures_may_lie_in_another_folder(tmp_path: Path, summed: Outcome) -> None:
    (tmp_path / "pictures #1").mkdir()
    (tmp_path / "pictures #1" / "trial.png").write_bytes(PNG)
    text = write(tmp_path, summed, figures=tmp_path / "pictures #1")
    (image,) = Page(text).all("img")
    assert image["src"] == "pictures%20%231/trial.png"


@pytest.mark.parametrize("name", ["../trial", "/trial", "a/b"])
def test_no_name_leads_out_of_the_folder(
    tmp_path: Path, summed: Outcome, name: str
) -> None:
    summed["name"] = summed["figures"][0]["file"] = name
    folder = tmp_path / "inner"
    folder.mkdir()
    report.write_report(
        folder / "report.html",
        title="",
        experiments=[summed],
        figures=folder,
        command="",
        made={},
    )
    assert {path.name for path in tmp_path.rglob("*")} == {
        *("inner", "report.html", "curves")
    }


def test_a_figure_that_is_not_there_is_left_out(
    tmp_path: Path, summed: Outcome
) -> None:
    write(tmp_path, summed)
    (tmp_path / "trial.png").unlink()
    summed["figures"][0]["file"] = "nowhere"
    empty = tmp_path / "empty"
    empty.mkdir()
    assert Page(write(tmp_path, summed, figures=empty)).all("img") == []


def test_what_it_is_given_is_escaped(tmp_path: Path, summed: Outcome) -> None:
    summed["studies"][0]["label"] = summed["title"] = '<b onclick="x">ACL & Co</b>'
    summed["table"]["rows"][0][0] = "<i>"
    text = write(tmp_path, summed, command="run <now>", claims=[CLAIM])
    for raw in ("<b ", "<i>", "<now>", "<so>"):
        assert raw not in text
    assert '<b onclick="x">ACL & Co</b>' in Page(text).text


def test_the_page_appears_complete_or_not_at_all(
    tmp_path: Path, summed: Outcome
) -> None:
    old = write(tmp_path, summed)
    del summed["studies"][0]["runs"]
    with pytest.raises(UndefinedError):
        write(tmp_path, summed)
    assert (tmp_path / "report.html").read_text() == old


@pytest.mark.parametrize("drawn", [True, False])
def test_the_claims_as_text(tmp_path: Path, summed: Outcome, drawn: bool) -> None:
    figures = tmp_path / "figures"
    figures.mkdir()
    if drawn:
        (figures / "trial.png").write_bytes(PNG)
    path = tmp_path / "claims.md"
    report.write_claims(path, [CLAIM], [summed], figures, "3 runs")
    text = path.read_text()
    trial = "[trial](figures/trial.png)" if drawn else "trial"
    assert f"| C1 | holds | **A claim.** §3; {trial} | | |" in text
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert {line.count("|") for line in rows} == {6}


@needs_chromium
@pytest.mark.parametrize(("width", "scheme"), [(1280, "dark"), (390, "light")])
def test_the_page_in_a_browser(
    tmp_path: Path, summed: Outcome, width: int, scheme: str
) -> None:
    """No errors, no scrolling sideways; the mouse, the keyboard and no script work."""
    reference = next(each for each in summed["studies"] if each["label"] == "J*")
    del reference["curves"]["sensitivity"]
    write(tmp_path, summed, claims=[CLAIM])
    wrong: list[str] = []
    with chromium() as browser:
        tab = new_tab(browser, width, scheme, wrong)
        address = (tmp_path / "report.html").as_uri()
        tab.goto(address)
        assert tab.evaluate("document.documentElement.scrollWidth") <= width
        paper = tab.evaluate("getComputedStyle(document.body).backgroundColor")
        assert (paper == "rgb(255, 255, 255)") == (scheme == "light")
        tab.keyboard.press("Tab")
        assert tab.evaluate("document.activeElement.textContent") == (
            "Skip to the content"
        )
        box = tab.get_by_role("group", name="Curves of trial")
        box.scroll_into_view_if_needed()
        choice = box.get_by_label("Setting")
        choice.select_option(label="ACL, crisp")
        box.get_by_label("Measure").select_option(label="sensitivity")
        plot = box.get_by_role("img")
        plot.hover(position={"x": plot.bounding_box()["width"] - 5, "y": 60})
        output = box.get_by_role("status")
        assert output.inner_text() == f"trial {TRIALS}: mean 0.05, from 0.05 to 0.05"
        assert str(plot.get_attribute("aria-label")).startswith(
            "sensitivity, ACL, crisp: at first trial 1: mean"
        )
        slider = box.get_by_label("Point on the curve")
        slider.focus()
        slider.press("Home")
        assert output.inner_text().startswith("trial 1: mean")
        assert slider.get_attribute("aria-valuetext") == output.inner_text()
        assert slider.evaluate("e => getComputedStyle(e).outlineStyle") == "solid"
        choice.select_option(label="J*")
        assert output.inner_text() == "This measure is not known of this setting."
        assert slider.is_disabled()
        picture = tab.locator("img").first
        assert picture.evaluate("e => e.complete && e.naturalWidth") == 1
        assert picture.bounding_box()["width"] <= width
        assert wrong == []
        quiet = browser.new_context(java_script_enabled=False).new_page()
        quiet.goto(address)
        assert quiet.locator("tr#C1 .verdict").is_visible()
        assert not quiet.locator(".explore").first.is_visible()
        (tmp_path / "curves" / "trial.js").unlink()
        alone = browser.new_page()
        alone.goto(address)
        lost = alone.get_by_text("There is no curves/trial.js beside this page.")
        lost.wait_for()
