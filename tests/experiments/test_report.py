import io
import re
from html.parser import HTMLParser

import pytest
from rich.console import Console

from acl_gym.experiments import report, statistics
from tests.experiments.factory import LABELS, OPTIMAL_COST, make_comparison, make_run

# Not a picture, but the report need not look inside.
PNG = b"\x89PNG\r\n\x1a\n" + bytes(range(50))
VOID = {"meta", "link", "img", "br"}


class Page(HTMLParser):
    """The page as a reader meets it; complains of tags that do not match."""

    def __init__(self, text):
        super().__init__()
        self.open = []
        self.tags = []
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.text += data

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture
def write(tmp_path):
    def write(comparison, found=("A finding.",)):
        figures = {}
        for name in ("summary", "learning_curves", "policy_maps", "trajectories"):
            figures[name] = tmp_path / f"{name}.png"
            figures[name].write_bytes(PNG + name.encode())
        summary = statistics.summarise(comparison["runs"], OPTIMAL_COST)
        path = tmp_path / "report.html"
        report.write_report(comparison, summary, list(found), figures, path)
        return path.read_text(encoding="utf-8")

    return write


def test_page_is_whole_and_in_english(write):
    text = write(make_comparison())
    page = Page(text)
    assert text.startswith("<!DOCTYPE html>")
    assert page.all("html") == [{"lang": "en"}]
    assert {"charset": "utf-8"} in page.all("meta")
    assert any(tag.get("name") == "viewport" for tag in page.all("meta"))
    assert "prefers-color-scheme: dark" in text
    assert len(page.all("h1")) == 1


def test_holds_everything(write):
    comparison = make_comparison()
    page = Page(write(comparison, ["First finding.", "Second finding."]))
    shown = " ".join(page.text.split())
    for label in LABELS.values():
        assert shown.count(label) >= 2  # in the summary and in the settings
    for part in (
        "First finding.",
        "Second finding.",
        "acl_gym/Pendulum-v0",
        "J* = 40.0",
        "400 × 401 cells",
        "mean cost",
        "python benchmarks/compare_acl_rl.py --preset quick",
        "0.1.0",
        "2026-01-31",
        "3.11.2",
        "a CPU",
        "epsilon",
        "64 × 64",
        "0, 1, 2",
    ):
        assert part in shown
    assert "None" not in shown
    assert "Undefined" not in shown


def test_loads_nothing(write):
    text = write(make_comparison())
    page = Page(text)
    assert "://" not in text
    assert page.all("script") == []
    assert "@import" not in text
    assert "url(" not in text
    for tag, attributes in page.tags:
        for name in ("src", "href"):
            assert attributes.get(name, "data:").startswith("data:"), tag


def test_figures_are_inside_with_words_for_those_who_do_not_see_them(write):
    page = Page(write(make_comparison()))
    images = page.all("img")
    assert len(images) == 4
    assert len({image["src"] for image in images}) == 4
    for image in images:
        assert image["src"].startswith("data:image/png;base64,")
        assert len(image["alt"]) > 60
    assert "fuzzy ACL" in images[0]["alt"]
    assert len(page.all("figcaption")) == 4


def test_tables_have_headers(write):
    page = Page(write(make_comparison()))
    for header in page.all("th"):
        assert header["scope"] in {"col", "colgroup", "row"}
    rows = len(LABELS)
    assert len(page.all("td")) >= rows * len(report.COLUMNS)


def test_escapes_what_it_is_given(write):
    label = '<b onclick="x">ACL & Co</b>'
    run = make_run("acl-fuzzy", 0, [45.0], label=label)
    run["parameters"] = {"<i>": "<u>"}
    comparison = {**make_comparison(), "runs": [run], "command": "run <now>"}
    text = write(comparison, [f"{label} is first."])
    for raw in ("<b ", "<i>", "<u>", "<now>"):
        assert raw not in text
    assert label in Page(text).text


def test_is_written_whole_or_not_at_all(write, tmp_path, monkeypatch):
    write(make_comparison())
    assert (
        sorted(path.suffix for path in tmp_path.iterdir()) == [".html"] + [".png"] * 4
    )
    old = (tmp_path / "report.html").read_text()
    with pytest.raises(KeyError):
        write({"runs": []})
    assert (tmp_path / "report.html").read_text() == old


class TestTable:
    def rows(self, *runs):
        summary = statistics.summarise(list(runs), OPTIMAL_COST)
        titles = [f"{column.group} {column.title}" for column in report.COLUMNS]
        return {
            label: dict(zip(titles, cells, strict=True))
            for label, cells in report.table_rows(summary)
        }

    def test_values_intervals_and_who_is_best(self):
        rows = self.rows(
            *(make_run("dqn", i, [c]) for i, c in enumerate([42.0, 44.0, 48.0])),
            make_run("q-fuzzy", 0, [46.0], every=500),
        )
        cell = rows["DQN"]["Last policy cost"]
        assert cell == ("44.0", "42.0–48.0", "", True)
        assert rows["DQN"]["Last policy above J*"].text == "+10.0%"
        assert rows["Q-learning, fuzzy"]["Last policy cost"] == ("46.0", "", "", False)
        assert rows["Q-learning, fuzzy"]["Within 25% of J* steps"].is_best
        assert rows["DQN"]["Within 25% of J* time, s"].text == "1.0"

    def test_all_alike_none_is_best(self):
        rows = self.rows(make_run("dqn", 0, [44.0]), make_run("q-fuzzy", 0, [44.0]))
        assert not any(cell.is_best for row in rows.values() for cell in row.values())

    def test_budgets_are_no_contest(self):
        rows = self.rows(make_run("dqn", 0, [44.0]), make_run("q-fuzzy", 0, [44.0] * 9))
        assert not rows["DQN"]["Whole training steps"].is_best

    def test_marks_reached_by_some_or_by_none(self):
        rows = self.rows(
            *(make_run("dqn", i, [c]) for i, c in enumerate([45.0, 70.0, 80.0]))
        )["DQN"]
        assert rows["Within 25% of J* steps"] == ("–", "1k–never", "1 of 3", False)
        assert rows["Within 10% of J* steps"] == ("never", "", "", False)


class TestPrintSummary:
    def printed(self, runs):
        summary = statistics.summarise(runs, OPTIMAL_COST)
        console = Console(file=io.StringIO(), width=100)
        report.print_summary(summary, {"optimal_cost": OPTIMAL_COST}, console)
        return console.file.getvalue()

    def test_fits_in_a_hundred_columns_with_nothing_cut(self):
        comparison = make_comparison()
        text = self.printed(comparison["runs"])
        assert "…" not in text
        for label in LABELS.values():
            assert re.search(rf"^{re.escape(label)} ", text, re.MULTILINE)
        assert "J* = 40.0" in text

    def test_fits_where_figures_are_long(self):
        runs = [
            make_run("q-fuzzy", i, [c], every=1_230_000, seconds=123.0)
            for i, c in enumerate([1234.5, 2345.6, 2999.9])
        ]
        runs += [make_run("dqn", 0, [44.0], every=1_230_000, seconds=12345.0)]
        assert "…" not in self.printed(runs)

    def test_a_label_is_not_markup(self):
        run = make_run("dqn", 0, [44.0], label="[red]DQN[/red]")
        assert "[red]DQN[/red]" in self.printed([run])
