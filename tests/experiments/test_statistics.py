import json
import math

import numpy as np
import pytest

from acl_gym.experiments import intervals, statistics, wording
from tests.experiments.factory import (
    OPTIMAL_COST,
    make_comparison,
    make_navigation,
    make_run,
)

REFERENCE = {"optimal_cost": 40.0}


def summarise(*runs):
    return statistics.summarise(list(runs), 40.0)


def say(*runs, preset="full"):
    return "\n".join(statistics.findings(summarise(*runs), REFERENCE, preset))


class TestSummarise:
    def test_one_entry_for_each_agent_in_order(self):
        summary = statistics.summarise(make_comparison()["runs"], OPTIMAL_COST)
        assert [entry["agent"] for entry in summary] == [
            "acl-fuzzy",
            "acl-crisp",
            "q-fuzzy",
            "q-crisp",
            "q-lambda-fuzzy",
            "q-lambda-crisp",
            "dqn",
        ]
        assert [entry["seeds"] for entry in summary] == [3] * 7

    def test_figures_computed_by_hand(self):
        # Within 25% of 40 is 50, within 10% is 44.
        (entry,) = summarise(
            make_run("dqn", 0, [90.0, 50.0, 44.0, 48.0]),
            make_run("dqn", 1, [60.0, 51.0, 43.0, 46.0]),
            make_run("dqn", 2, [49.0, 41.0, 70.0, 56.0]),
        )
        assert entry["final_policy_cost"]["median"] == 48.0
        assert entry["best_policy_cost"]["median"] == 43.0
        assert entry["final_gap_percent"]["median"] == pytest.approx(20.0)
        assert entry["best_gap_percent"]["median"] == pytest.approx(7.5)
        assert entry["final_success_rate"]["median"] == 1.0
        assert entry["env_steps"]["median"] == 4000
        assert entry["seconds"]["median"] == 4.0
        # First at or below 50: evaluations 2, 3, 1; at or below 44: 3, 3, 2.
        assert entry["env_steps_to_25"]["median"] == 2000
        assert entry["seconds_to_25"]["median"] == 2.0
        assert entry["env_steps_to_10"]["median"] == 3000
        assert entry["seconds_to_10"]["reached"] == 3
        # Of three values the interval of the median is their range.
        assert entry["final_policy_cost"]["low"] == 46.0
        assert entry["final_policy_cost"]["high"] == 56.0
        assert entry["env_steps_to_25"]["low"] == 1000

    def test_success_of_the_last_and_of_the_best_policy(self):
        (entry,) = summarise(make_run("dqn", 0, [90.0, 45.0, 70.0]))
        assert entry["final_success_rate"]["median"] == 0.5
        assert entry["best_success_rate"]["median"] == 1.0

    def test_marks_never_reached_are_none_and_counted(self):
        (entry,) = summarise(
            make_run("dqn", 0, [45.0]),
            make_run("dqn", 1, [90.0]),
            make_run("dqn", 2, [80.0]),
        )
        assert entry["env_steps_to_25"] == {
            "median": None,
            "low": 1000,
            "high": None,
            "reached": 1,
        }
        assert entry["seconds_to_10"] == {
            "median": None,
            "low": None,
            "high": None,
            "reached": 0,
        }
        # JSON knows no infinity.
        json.dumps(entry, allow_nan=False)

    def test_half_of_the_seeds_is_not_the_median(self):
        (entry,) = summarise(make_run("dqn", 0, [45.0]), make_run("dqn", 1, [90.0]))
        assert entry["env_steps_to_25"]["median"] is None
        assert entry["env_steps_to_25"]["reached"] == 1

    def test_one_seed_has_no_interval(self):
        (entry,) = summarise(make_run("dqn", 0, [45.0]))
        assert entry["final_policy_cost"] == {"median": 45.0, "low": None, "high": None}

    def test_figures_of_an_agent_do_not_hang_on_the_others(self):
        runs = make_comparison(seeds=8)["runs"]
        everyone = statistics.summarise(runs, 40.0)
        alone = statistics.summarise([r for r in runs if r["agent"] == "dqn"], 40.0)
        assert alone == [entry for entry in everyone if entry["agent"] == "dqn"]

    def test_no_runs(self):
        assert statistics.summarise([], 40.0) == []
        assert statistics.findings([], REFERENCE, "quick") == []

    @pytest.mark.parametrize("cost", [0.0, -1.0, math.nan])
    def test_rejects_an_optimum_that_is_not_positive(self, cost):
        with pytest.raises(ValueError, match="optimal_cost must lie in"):
            statistics.summarise([], cost)


class TestEstimate:
    @pytest.mark.parametrize("count", [2, 3, 5, 6, 10, 30])
    def test_interval_holds_the_median(self, count):
        values = np.random.default_rng(count).lognormal(4.0, 0.5, count)
        found = intervals.estimate(values.tolist(), seed=3)
        assert found["median"] == np.median(values)
        assert values.min() <= found["low"] <= found["median"] <= found["high"]
        assert found["high"] <= values.max()

    def test_interval_is_the_range_up_to_few_values_and_narrower_beyond(self):
        for count in (2, intervals.FEW_VALUES, intervals.FEW_VALUES + 1):
            found = intervals.estimate([float(i) for i in range(count)])
            is_range = (found["low"], found["high"]) == (0.0, count - 1.0)
            assert is_range == (count <= intervals.FEW_VALUES)

    def test_same_seed_same_interval(self):
        values = [3.0, 1.0, 4.0, 1.5, 9.0, 2.6, 5.0, 3.5]
        assert intervals.estimate(values, seed=1) == intervals.estimate(values, seed=1)

    def test_an_average_with_infinity_is_infinite(self):
        found = intervals.estimate([1.0, 2.0, math.inf, math.inf])
        assert found["median"] is None
        assert found["high"] is None

    @pytest.mark.parametrize(
        ("first", "second", "expected"),
        [
            ((1.0, 3.0), (2.0, 4.0), True),
            ((1.0, 2.0), (2.0, 4.0), True),
            ((1.0, 2.0), (3.0, 4.0), False),
            ((3.0, 4.0), (1.0, 2.0), False),
            ((1.0, None), (5.0, 6.0), True),
            ((7.0, None), (5.0, 6.0), False),
            ((None, None), (5.0, 6.0), False),
        ],
    )
    def test_overlap(self, first, second, expected):
        made = [{"median": 0.0, "low": a, "high": b} for a, b in (first, second)]
        assert intervals.overlap(*made) is expected


class TestRuns:
    def test_time_to_takes_the_first_evaluation_at_or_below(self):
        run = make_run("dqn", 0, [90.0, 50.0, 70.0, 40.0], seconds=0.5)
        assert statistics.time_to(run, 50.0) == 2000
        assert statistics.time_to(run, 49.9, "seconds") == 2.0
        assert statistics.time_to(run, 39.9) == math.inf

    def test_median_run_by_final_cost_the_cheaper_of_two(self):
        runs = [make_run("dqn", i, [c]) for i, c in enumerate([50.0, 42.0, 61.0, 44.0])]
        assert statistics.median_run(runs[:3])["seed"] == 0
        assert statistics.median_run(runs)["seed"] == 3
        assert statistics.median_run(runs[:1])["seed"] == 0


class TestCurveBand:
    def test_step_functions_of_seeds_that_are_evaluated_at_other_times(self):
        first = make_run("dqn", 0, [80.0, 60.0, 70.0], every=10)
        second = make_run("dqn", 1, [50.0, 90.0], every=15)
        band = statistics.curve_band([first, second])
        # At 15 the first has 80 and the second 50; from 30 on both keep their last.
        assert band.x.tolist() == [15, 20, 30]
        assert band.low.tolist() == [50.0, 50.0, 70.0]
        assert band.high.tolist() == [80.0, 60.0, 90.0]
        assert band.median.tolist() == [65.0, 55.0, 80.0]

    def test_best_so_far_never_rises(self):
        run = make_run("dqn", 0, [80.0, 60.0, 70.0, 50.0])
        band = statistics.curve_band([run], "seconds", best_so_far=True)
        assert band.x.tolist() == [1.0, 2.0, 3.0, 4.0]
        assert band.median.tolist() == [80.0, 60.0, 60.0, 50.0]

    def test_a_seed_that_has_ended_keeps_its_last_policy(self):
        short = make_run("dqn", 0, [50.0], every=10)
        long = make_run("dqn", 1, [90.0, 80.0, 70.0], every=10)
        band = statistics.curve_band([short, long])
        assert band.low.tolist() == [50.0, 50.0, 50.0]
        assert band.high.tolist() == [90.0, 80.0, 70.0]

    def test_no_runs(self):
        assert statistics.curve_band([]).x.size == 0


class TestFindings:
    def test_names_who_is_first_in_what(self):
        text = say(
            make_run("acl-fuzzy", 0, [49.0, 43.0], every=10_000, seconds=0.1),
            make_run("q-fuzzy", 0, [90.0, 41.0], every=20_000, seconds=0.2),
            make_run("dqn", 0, [49.0, 46.0], every=1000, seconds=10.0),
        )
        lines = text.splitlines()
        assert lines[0].startswith(
            "To come within 25% of J* (50.0), fuzzy ACL needs the least wall-clock "
            "time: 0.10 s, then fuzzy Q-learning with 0.40 s, 4 times as much."
        )
        assert lines[1].startswith(
            "To come within 25% of J* (50.0), DQN needs the fewest environment steps: "
            "1,000, then fuzzy ACL with 10,000, 10 times as many."
        )
        assert "within 10% of J* (44.0), fuzzy ACL needs the least" in lines[2]
        assert "Never reached: DQN." in lines[2]
        assert "Fuzzy Q-learning ends lowest with its last policy: 41.0, 2.5%" in text
        assert "Fuzzy Q-learning finds the cheapest policy on its way: 41.0" in text

    def test_says_where_the_colony_loses_and_by_how_much(self):
        text = say(
            make_run("acl-fuzzy", 0, [49.0, 44.0], every=10_000, seconds=0.1),
            make_run("q-fuzzy", 0, [42.0, 40.0], every=2_000, seconds=0.2),
        )
        (losses,) = [line for line in text.splitlines() if "loses to" in line]
        assert losses == (
            "Where fuzzy ACL loses to fuzzy Q-learning: last policy, 44.0 against 40.0 "
            "(10.0% more); best policy, 44.0 against 40.0 (10.0% more); environment "
            "steps to 25%, 10,000 against 2,000 (5 times as many); environment steps "
            "to 10%, 20,000 against 2,000 (10 times as many)."
        )
        (gains,) = [line for line in text.splitlines() if "is ahead of" in line]
        assert gains == (
            "Where fuzzy ACL is ahead of fuzzy Q-learning: wall-clock time to 25%, "
            "0.10 s against 0.20 s."
        )

    def test_compares_with_the_best_of_each_family(self):
        text = say(
            make_run("acl-fuzzy", 0, [48.0]),
            make_run("acl-crisp", 0, [70.0]),
            make_run("q-fuzzy", 0, [42.0]),
            make_run("q-crisp", 0, [41.0]),
            make_run("dqn", 0, [55.0]),
        )
        assert "fuzzy ACL loses to crisp Q-learning" in text
        assert "fuzzy ACL loses to fuzzy Q-learning" not in text
        assert "fuzzy ACL is ahead of crisp ACL" in text
        assert "fuzzy ACL is ahead of DQN" in text

    def test_says_so_where_intervals_overlap(self):
        acl = [make_run("acl-fuzzy", i, [c]) for i, c in enumerate([44.0, 46.0, 48.0])]
        near = [make_run("dqn", i, [c]) for i, c in enumerate([45.0, 47.0, 49.0])]
        far = [make_run("dqn", i, [c]) for i, c in enumerate([55.0, 57.0, 59.0])]
        ends = "Fuzzy ACL ends lowest with its last policy: 46.0 (44.0 to 48.0)"

        def last_policy(*runs):
            return next(x for x in say(*runs).splitlines() if x.startswith(ends))

        assert last_policy(*acl, *near).endswith("; the intervals overlap.")
        assert "overlap" not in last_policy(*acl, *far)

    def test_nobody_reaches_a_mark(self):
        runs = [make_run(agent, 0, [90.0, 80.0]) for agent in ("acl-fuzzy", "dqn")]
        text = say(*runs)
        assert (
            "No method comes within 25% of J* (50.0) in more than half of its seeds. "
            "Never reached: fuzzy ACL and DQN."
        ) in text
        assert "needs the" not in text

    def test_who_reached_it_in_some_seeds_only(self):
        text = say(
            *(make_run("acl-fuzzy", i, [c]) for i, c in enumerate([45.0, 70.0, 80.0])),
            *(make_run("dqn", i, [45.0]) for i in range(3)),
        )
        assert "Reached in a part of the seeds: fuzzy ACL in 1 of 3." in text
        assert "only in 1 of 3 seeds against 1,000" in text

    def test_one_agent_alone(self):
        text = say(make_run("q-crisp", 0, [45.0]))
        assert "crisp Q-learning needs the least" in text
        assert "then" not in text
        assert "loses" not in text
        assert "budgets" not in text

    def test_a_run_of_the_agent_that_ends_below_the_optimum(self):
        assert "38.0, 5.0% below J* (40.0)" in say(make_run("dqn", 0, [38.0]))

    def test_how_many_seeds(self):
        def text(seeds):
            return say(*(make_run("dqn", i, [45.0]) for i in range(seeds)))

        assert "With one seed nothing is known about the spread (preset full)." in text(
            1
        )
        assert "over 3 seeds, with so few the range of the runs" in text(3)
        assert text(10).endswith("of the median over 10 seeds (preset full).")

    def test_goal_reached_from_not_quite_every_start(self):
        run = make_run("dqn", 0, [45.0])
        run["rows"][-1]["success_rate"] = 0.996
        text = say(run, make_run("acl-fuzzy", 0, [45.0]))
        assert "from 99.6% of the starts with DQN; from every start with" in text

    def test_kinds_of_traces_are_families_of_their_own(self):
        text = say(
            make_run("acl-fuzzy", 0, [48.0]),
            make_run("q-fuzzy", 0, [42.0]),
            make_run("q-lambda-fuzzy", 0, [43.0]),
            make_run("q-lambda-crisp", 0, [44.0]),
        )
        assert "fuzzy ACL loses to fuzzy Q-learning" in text
        assert "fuzzy ACL loses to fuzzy Q(λ)" in text
        assert "fuzzy ACL loses to crisp Q(λ)" not in text

    def test_where_the_optimum_is_not_known(self):
        comparison = make_navigation()
        summary = statistics.summarise(comparison["runs"], OPTIMAL_COST)
        text = "\n".join(statistics.findings(summary, comparison["reference"], "quick"))
        assert "within 25% of the best known cost (50.0)" in text
        assert "J*" not in text
        assert "9 x 3 x 9 x 3 cells" in text

    def test_those_that_share_the_first_place(self):
        runs = [make_run(agent, 0, [40.0]) for agent in ("acl-crisp", "q-crisp", "dqn")]
        text = say(*runs, make_run("q-fuzzy", 0, [50.0]))
        assert (
            "Crisp ACL, crisp Q-learning and DQN end lowest with their last policies, "
            "in the median at 40.0, equal to J* (40.0)."
        ) in text
        assert "fuzzy Q-learning find" not in text

    def test_equal_to_the_optimum(self):
        text = say(make_run("dqn", 0, [40.0]))
        assert "40.0, equal to J* (40.0)" in text

    def test_what_the_partition_allows(self):
        comparison = make_comparison(seeds=1)
        summary = statistics.summarise(comparison["runs"], OPTIMAL_COST)
        found = statistics.findings(summary, comparison["reference"], "quick")
        (sentence,) = [text for text in found if "Q-iteration" in text]
        assert "52.3 on 40 x 41 cells" in sentence
        assert "33% of the starts" in sentence
        # Every sentence is one: a capital letter, a full stop, no number of Python's.
        for text in found:
            assert text[0].isupper()
            assert text.endswith(".")
            assert "None" not in text
            assert "nan" not in text.split()


class TestWording:
    @pytest.mark.parametrize(
        ("value", "text", "short"),
        [
            (None, "never", "never"),
            (950, "950", "950"),
            (8_000, "8,000", "8k"),
            (486_743, "487,000", "487k"),
            (999_800, "1 million", "1M"),
            (1_912_345, "1.91 million", "1.91M"),
        ],
    )
    def test_steps(self, value, text, short):
        assert wording.steps(value) == text
        assert wording.steps(value, short=True) == short

    @pytest.mark.parametrize(
        ("value", "text"),
        [
            (None, "never"),
            (0.0333, "0.033"),
            (0.5, "0.50"),
            (4.776, "4.8"),
            (63.2, "63"),
        ],
    )
    def test_seconds(self, value, text):
        assert wording.seconds(value) == text

    def test_lists_and_labels(self):
        assert wording.listed([]) == ""
        assert wording.listed(["a"]) == "a"
        assert wording.listed(["a", "b", "c"]) == "a, b and c"
        assert wording.in_a_sentence("Q-learning, fuzzy") == "fuzzy Q-learning"
        assert wording.in_a_sentence("DQN") == "DQN"
        assert wording.ratio(1240.4) == "1,240 times"
        assert wording.share(0.33) == "33%"
