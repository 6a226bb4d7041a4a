"""The figures of experiments, all in one style."""

from __future__ import annotations

import io
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from acl_gym.experiments import systems
from acl_gym.experiments.methods import make_agent
from acl_gym.experiments.plots import curves, dots, policies, swarms, theory
from acl_gym.experiments.plots.looks import in_symbols
from acl_gym.experiments.results import Results
from acl_gym.experiments.study import Experiment
from acl_gym.plotting.animation import SHOWN, animate
from acl_gym.plotting.style import in_style
from acl_gym.utils.files import write_atomically

PLOTS: dict[str, Callable[[Experiment[Any], Results], Figure]] = {
    "bands": curves.bands,
    "measures": curves.measures,
    "policies": policies.policies,
    "baseline": policies.baseline,
    "bands_and_policies": curves.bands_and_policies,
    "swing": policies.swing,
    "level_band": theory.level_band,
    "policy_gap": theory.policy_gap,
    "race": curves.race,
    "strips": dots.strips,
    "sweep": dots.sweep,
    "order": dots.order,
    "summary": dots.summary,
    "learning_curves": curves.learning_curves,
    "returns": curves.returns,
    "policy_maps": policies.policy_maps,
    "trajectories": policies.trajectories,
    "centre": swarms.centre,
    "delays": swarms.delays,
    "foraging": swarms.foraging,
    "optimum": swarms.optimum,
    "least_values": swarms.least_values_over_time,
    "colonies": swarms.colonies,
}
"""What draws the figure of each name."""

CAPTIONS: dict[str, dict[str, str]] = tomllib.loads(
    files(__package__).joinpath("captions.toml").read_text(encoding="utf-8")
)
"""For the figure of each name the `text` below it, and `alt`, what it shows."""


@in_style()
def draw(plot: str, experiment: Experiment[Any], results: Results) -> Figure:
    """Draw a figure.

    Args:
        plot: a key of `PLOTS`.
        experiment: what is shown.
        results: its runs.
    """
    figure = PLOTS[plot](experiment, results)
    figure.suptitle(in_symbols(experiment.title), x=0.01, ha="left")
    return figure


def file_name(experiment: Experiment[Any], plot: str) -> str:
    """The name of a figure's files: that of the experiment, or of one figure of many."""
    return experiment.name if len(experiment.plots) == 1 else plot


class FigureFailedError(RuntimeError):
    """Figures could not be drawn or written; the results are there.

    Args:
        directory: where the results are.
        failures: what the figures raised.
    """

    def __init__(self, directory: Path, failures: Sequence[Exception]) -> None:
        first = failures[0]
        super().__init__(
            f"figures of {directory} failed ({len(failures)}), the first with "
            f"{type(first).__name__}: {str(first).rstrip('.')}; all results are written, "
            "and the report without these figures. Give the same command again when the "
            "cause is removed."
        )
        self.failures = failures


@contextmanager
def drawing(directory: Path) -> Iterator[Callable[..., None]]:
    """Draw figures so that one that fails stops neither the others nor the report.

    Args:
        directory: where the results are, for the message.

    Yields:
        A function that calls its first argument with the others.

    Raises:
        FigureFailedError: at the end, if a call has failed.
    """
    failures: list[Exception] = []

    def attempt(draw: Callable[..., None], *arguments: Any) -> None:
        try:
            draw(*arguments)
        except FigureFailedError as error:
            failures.extend(error.failures)
        except Exception as error:
            failures.append(error)

    yield attempt
    if failures:
        raise FigureFailedError(directory, failures) from failures[0]


def save(
    experiment: Experiment[Any],
    results: Results,
    directory: Path,
    kinds: tuple[str, ...] = ("png", "svg"),
) -> None:
    """Draw all figures of an experiment and write them, see `file_name`.

    Args:
        experiment: which.
        results: its runs.
        directory: where; each file appears complete or not at all.
        kinds: endings of files.

    Raises:
        FigureFailedError: a figure failed; the others are written.
    """
    with drawing(directory) as attempt:
        for plot in experiment.plots:
            attempt(_save_figure, plot, experiment, results, directory, kinds)


@in_style()
def _save_figure(
    plot: str,
    experiment: Experiment[Any],
    results: Results,
    directory: Path,
    kinds: tuple[str, ...],
) -> None:
    figure = draw(plot, experiment, results)
    for kind in kinds:
        buffer = io.BytesIO()
        figure.savefig(buffer, format=kind)
        path = directory / f"{file_name(experiment, plot)}.{kind}"
        write_atomically(path, buffer.getvalue())


def write_animation(path: Path, trials: tuple[int, ...] = SHOWN) -> None:
    """Write how 250 ants learn the fuzzy pendulum of Table 5.2, see `animate`."""
    study = systems.pendulum("fuzzy")
    animate(make_agent(study, seed=0), path, trials=trials)
