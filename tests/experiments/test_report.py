"""What experiments found, as JSON and as one page."""

from __future__ import annotations

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
from tests.experiments.synthetic import (
    TRIALS,
    make_experiment,
    make_results,
    pendulums,
)

# Not a picture, but the report does not look inside.
PNG = b"\x89PNG\r\n\x1a\n" + bytes(range(50))
VOID = {"meta", "link", "img", "br"}


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
    (best,) = [cell for cell in page.all("td") if cell.get("class") == "best"]
    assert best["data-heading"] == "last, cost"
    assert all(cell["scope"] in ("col", "row") for cell in page.all("th"))


def test_the_page_loads_nothing_and_its_links_lead_somewhere(
    tmp_path: Path, summed: Outcome
) -> None:
    summed["claims"] = ["C1"]
    text = write(tmp_path, summed, claims=[CLAIM])
    page = Page(text)
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text)
    for _, attributes in page.tags:
        assert str(attributes.get("src", "data:")).startswith("data:")
    ids = [str(a["id"]) for _, a in page.tags if "id" in a]
    assert len(ids) == len(set(ids))
    links = [str(a["href"])[1:] for a in page.all("a")]
    assert sorted(links) == ["C1", "trial"], "what was not run has no link"
    assert set(links) <= set(ids)


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


def test_the_claims_as_text(tmp_path: Path) -> None:
    report.write_claims(tmp_path / "claims.md", [CLAIM], {"trial"}, "3 runs")
    text = (tmp_path / "claims.md").read_text()
    assert "| C1 | holds | **A claim.** §3; trial | | |" in text
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert {line.count("|") for line in rows} == {6}


CHROMIUM = next(
    filter(Path.exists, map(Path, ("/usr/bin/chromium", "/usr/bin/chromium-browser"))),
    None,
)


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (apt install chromium)")
@pytest.mark.parametrize(("width", "scheme"), [(1280, "dark"), (390, "light")])
def test_the_page_in_a_browser(
    tmp_path: Path, summed: Outcome, width: int, scheme: str
) -> None:
    """No errors, no requests, no scrolling sideways; hovering and no script work."""
    sync = pytest.importorskip("playwright.sync_api")
    write(tmp_path, summed, claims=[CLAIM])
    wrong: list[str] = []
    with sync.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"]
        )
        tab = browser.new_page(
            viewport={"width": width, "height": 800}, color_scheme=scheme
        )
        tab.on("pageerror", lambda error: wrong.append(str(error)))
        address = (tmp_path / "report.html").as_uri()
        tab.goto(address)
        assert tab.evaluate("document.documentElement.scrollWidth") <= width
        paper = tab.evaluate("getComputedStyle(document.body).backgroundColor")
        assert (paper == "rgb(255, 255, 255)") == (scheme == "light")
        box = tab.locator('.explore[data-name="trial"]')
        choice, measure = box.locator("select").all()
        choice.select_option(label="ACL, crisp")
        measure.select_option(label="sensitivity")
        plot = box.locator("svg")
        plot.hover(position={"x": plot.bounding_box()["width"] - 5, "y": 60})
        shown = box.locator("output").inner_text()
        assert shown == f"trial {TRIALS}: mean 0.05, from 0.05 to 0.05"
        quiet = browser.new_context(java_script_enabled=False).new_page()
        quiet.goto(address)
        assert quiet.locator("tr#C1 .verdict").is_visible()
        assert not quiet.locator(".explore").first.is_visible()
        browser.close()
    assert wrong == []
