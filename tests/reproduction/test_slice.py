"""A slice of every experiment runs, is judged, drawn, and told on a page."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from acl_gym.reproduction import evidence as evidence_module
from acl_gym.reproduction import figures, page, reproduce
from acl_gym.reproduction import outcome as outcomes
from acl_gym.reproduction.catalogue import BY_NAME, EXPERIMENTS
from acl_gym.reproduction.claims import CLAIMS
from acl_gym.reproduction.settings import Experiment
from acl_gym.reproduction.systems import swing
from tests.reproduction.slices import SEEDS, TRIALS, evidence, runs_of

DRAWN = list(
    {
        (each.drawing, each.studies[0].setting.kernels[0]): each for each in EXPERIMENTS
    }.values()
)
"""One experiment for each way of drawing each system."""


@pytest.fixture(autouse=True)
def short_iterations(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fuzzy Q-iteration of three sweeps, not 500."""
    whole = evidence_module.fuzzy_q_iteration

    def short(*arguments: Any, **options: Any) -> Any:
        return whole(*arguments, **{**options, "max_iterations": 3})

    monkeypatch.setattr(evidence_module, "fuzzy_q_iteration", short)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results and figures as `reproduce` leaves them, and the page."""
    path = tmp_path_factory.mktemp("reproduction")
    (path / "figures").mkdir()
    patch = pytest.MonkeyPatch()
    short_iterations.__wrapped__(patch)  # type: ignore[attr-defined]
    for experiment in DRAWN:
        figures.save(experiment, evidence(), path / "figures")
    figures.animation.animate(path / "figures" / "learning.gif", shown=(0, 1))
    outcome = outcomes.outcome_of(list(EXPERIMENTS), evidence(), SEEDS, 0, {})
    patch.undo()
    (path / "results.json").write_text(json.dumps(outcome))
    page.write_page(path)
    return path


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.name)
def test_every_claim_is_decided(claim: Any) -> None:
    found = claim.judge(evidence())
    assert found["verdict"] in ("holds", "holds in part", "does not hold")
    assert json.loads(json.dumps(found)) == found
    for part in found["parts"]:
        assert part["statement"]
        assert part["measured"]


@pytest.mark.parametrize("experiment", DRAWN, ids=lambda each: each.name)
def test_every_kind_of_figure_is_drawn(folder: Path, experiment: Experiment) -> None:
    png = folder / "figures" / f"{experiment.name}.png"
    svg = folder / "figures" / f"{experiment.name}.svg"
    assert png.read_bytes().startswith(b"\x89PNG")
    assert png.stat().st_size > 5_000
    assert "<svg" in svg.read_text()[:1000]


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda each: each.name)
def test_every_summary_is_json_with_curves(experiment: Experiment) -> None:
    text = json.dumps(outcomes.summary(experiment, evidence()), allow_nan=False)
    found = json.loads(text)
    for study, own in zip(found["studies"], experiment.studies, strict=True):
        assert study["runs"] == runs_of(own.setting.most_runs)
        assert study["parameters"] == own.setting.text
        points = TRIALS if study["positions"] is None else len(study["positions"])
        for curve in study["curves"].values():
            assert len(curve["mean"]) == points
            for low, mean, high in zip(
                curve["low"], curve["mean"], curve["high"], strict=True
            ):
                assert low <= mean * (1 + 1e-4) + 1e-9
                assert mean <= high * (1 + 1e-4) + 1e-9


def keys_of(names: list[str]) -> set[str]:
    return {
        setting.key
        for setting in reproduce.settings_of(BY_NAME[name] for name in names)
    }


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.name)
def test_a_claim_needs_its_own_experiments_alone(claim: Any) -> None:
    own = evidence().of(keys_of(claim.experiments))
    assert claim.judge(own)["verdict"] != "undecided"
    # What was tried is all told once its experiments are there too.
    tried = claim.attempts(evidence().of(keys_of([*claim.experiments, *claim.trials])))
    assert len(tried) == len(claim.tried)
    assert all(each.what and each.found for each in tried)
    if claim.trials:
        assert len(claim.attempts(own)) < len(tried), "they are not looked at"
    decisive = {"C1", "C2", "C3", "C17", "C21"}
    assert claim.tried or claim.name in decisive


class Links(HTMLParser):
    """All ids, internal links and addresses of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.sources: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        if "id" in found:
            self.ids.append(str(found["id"]))
        if tag == "a":
            self.links.append(str(found["href"]))
        if "src" in found:
            self.sources.append(str(found["src"]))


def test_the_page_is_one_file_and_its_links_lead_somewhere(folder: Path) -> None:
    text = (folder / "report.html").read_text()
    links = Links()
    links.feed(text)
    assert len(set(links.ids)) == len(links.ids)
    assert links.links
    assert all(link.startswith("#") and link[1:] in links.ids for link in links.links)
    assert len(links.sources) == len(DRAWN) + 1
    assert all(source.startswith("data:image/") for source in links.sources)
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text)
    for claim in CLAIMS:
        assert claim.name in links.ids


def test_the_claims_as_text(folder: Path) -> None:
    lines = page.write_claims(folder).read_text().splitlines()
    for claim in CLAIMS:
        assert sum(line.startswith(f"| {claim.name} | ") for line in lines) == 1
    rows = [line for line in lines if line.startswith("|")]
    assert {line.count("|") for line in rows} == {6}
    assert not any("; |" in line for line in rows)  # no figure, no separator


def test_a_page_needs_results(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"there is no results\.json in"):
        page.write_page(tmp_path)
    for content in ("{", "[]", "{}", '{"claims": []}'):
        (tmp_path / "results.json").write_text(content)
        with pytest.raises(ValueError, match="is not the result of a reproduction"):
            page.write_page(tmp_path)


CHROMIUM = next(
    (p for p in map(Path, ("/usr/bin/chromium", "/usr/bin/chromium-browser"))
     if p.exists()),
    None,
)  # fmt: skip


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (apt install chromium)")
@pytest.mark.parametrize(("width", "scheme"), [(1200, "dark"), (390, "light")])
def test_the_page_in_a_browser(folder: Path, width: int, scheme: str) -> None:
    """No errors, no requests, every picture visible, links and hovering work."""
    sync = pytest.importorskip("playwright.sync_api")
    wrong: list[str] = []
    with sync.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=str(CHROMIUM),
            args=["--no-sandbox", "--disable-gpu", "--disable-background-networking"],
        )
        tab = browser.new_page(
            viewport={"width": width, "height": 800}, color_scheme=scheme
        )
        tab.on("console", lambda m: m.type == "error" and wrong.append(m.text))
        tab.on("pageerror", lambda error: wrong.append(str(error)))
        tab.on(
            "request",
            lambda r: r.url.startswith(("file:", "data:")) or wrong.append(r.url),
        )
        tab.goto((folder / "report.html").as_uri())
        for image in tab.locator("figure img").all():
            image.scroll_into_view_if_needed()
            tab.wait_for_function(
                "image => image.complete && image.naturalWidth > 0",
                arg=image.element_handle(),
            )
            assert image.is_visible()
        overflow = tab.evaluate("document.documentElement.scrollWidth")
        assert overflow <= width, "no scrolling sideways"
        tab.locator("tr#C14 a").first.click()
        assert tab.url.endswith("#fig5.4")
        box = tab.locator('.explore[data-name="fig5.4"]')
        choice, measure = box.locator("select").all()
        choice.select_option(label="rho = 0.1")
        measure.select_option(label="sensitivity")
        plot = box.locator("svg")
        plot.hover(position={"x": plot.bounding_box()["width"] - 5, "y": 60})
        curve = evidence().rows(swing("fuzzy"), "sensitivity")[:, -1]
        told = box.locator("output").inner_text()
        assert told.startswith(f"trial {TRIALS}: mean {curve.mean():.4g}, from ")
        assert told.endswith(f"from {curve.min():.4g} to {curve.max():.4g}")
        words = plot.locator("text").all_text_contents()
        assert {"trial", "sensitivity", "1"} <= set(words)
        paper = tab.evaluate("getComputedStyle(document.body).backgroundColor")
        assert (paper == "rgb(255, 255, 255)") == (scheme == "light")
        browser.close()
    assert wrong == []


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (apt install chromium)")
def test_the_page_without_javascript(folder: Path) -> None:
    sync = pytest.importorskip("playwright.sync_api")
    with sync.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"]
        )
        tab = browser.new_context(java_script_enabled=False).new_page()
        tab.goto((folder / "report.html").as_uri())
        assert tab.locator("tr#C1 .verdict").is_visible()
        assert not tab.locator(".explore").first.is_visible()
        assert tab.locator("figure img").first.is_visible()
        browser.close()
