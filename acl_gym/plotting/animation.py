"""How a colony learns, as a film: its policy, its pheromone, and what the policy does."""

from __future__ import annotations

import io
import itertools
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation, writers
from matplotlib.figure import Figure
from PIL import Image

from acl_gym.agents.base import TabularAgent
from acl_gym.plotting import style
from acl_gym.plotting.names import Labels
from acl_gym.plotting.plane import Key
from acl_gym.plotting.scenes import Stage, draw_stage, stages_of
from acl_gym.utils import validation
from acl_gym.utils.files import checked_target, write_atomically

SHOWN = (0, 2, 4, 6, 8, 10, 12, 15, 20, 30, 60, 100)
"""After these trials of a new agent its policy is shown and followed."""

_COLOURS = 128
"""Of a GIF, one palette for all of its frames."""

_WHITE = 244
"""Of 255: lighter colours of a palette become white."""

_KINDS = (".gif", ".mp4")

_LONGEST = 3600.0
"""Seconds for which a policy may be followed: of more no file of frames is made."""


def animate(
    agent: TabularAgent,
    path: str | Path | None = None,
    *,
    trials: Sequence[int] | None = None,
    seconds: float = 3.0,
    env: Any = None,
    start: Any = None,
    axes: Sequence[Key] | None = None,
    slice: Mapping[Key, float] | None = None,
    labels: Labels = None,
    actions: Sequence[str] | None = None,
    dpi: float = 110,
) -> Any:
    """Let an agent learn, and film its policy, its pheromone and what the policy does.

    Args:
        agent: a new agent, which learns meanwhile; or one that has learned, which is
            shown as it is.
        path: of a `.gif` or, if ffmpeg is installed, an `.mp4` file, which appears
            complete or not at all. None writes nothing.
        trials: after which trials pictures are taken, increasing; the agent learns up
            to the last. None takes twelve between 0 and 100 if the agent is new, else
            only the present one.
        seconds: for how long each policy is followed at most, in (0, 3600]; where steps
            have no duration ten of them make a second.
        env: where the policies are shown; None takes the environment of the agent.
        start: the initial state of each showing, see `plot_trajectory`.
        axes: the state variables along the axes, see `plot_policy`.
        slice: values of other variables, see `plot_policy`.
        labels: names of the state variables, see `plot_policy`.
        actions: names of the actions, see `plot_policy`.
        dpi: dots an inch; the picture is 7.2 inches wide.

    Returns:
        The path written; without `path` a `matplotlib.animation.FuncAnimation`, whose
        `save` writes files and whose `to_jshtml` shows it in a notebook.

    Raises:
        TypeError: `agent` is no agent, or `path` no path.
        ValueError: an argument does not fit the agent, or `path` is of another kind.
        OSError: `path` cannot be written, which is found before the agent learns.
        RuntimeError: ffmpeg is missing.
    """
    if not isinstance(agent, TabularAgent):
        raise TypeError(
            "agent must be an agent that learns a table, such as ACL or QLearning, got "
            f"{validation.shown(agent)}; plot_policy draws policies."
        )
    target = None if path is None else _checked_path(path)
    seconds = validation.number("seconds", seconds, above=0, at_most=_LONGEST)
    dpi = validation.number("dpi", dpi, at_least=20, at_most=600)
    shown = _checked_trials(agent, trials)
    looks = {"axes": axes, "slice": slice, "labels": labels, "actions": actions}
    stages = stages_of(agent, shown, seconds, env, start, looks)
    film = _Film(stages, dpi)
    if target is None:
        return film.animation()
    if target.suffix.lower() == ".gif":
        write_atomically(target, _gif(film.pictures(), film.interval))
    else:
        write_atomically(target, _mp4(film))
    return target


class _Film:
    """A figure that shows one frame after another.

    Args:
        stages: the policies, with what they do.
        dpi: dots an inch.
    """

    def __init__(self, stages: list[Stage], dpi: float) -> None:
        with style.in_style():
            self.figure: Figure = style.new_figure(2.75, dpi=dpi)
            self._panels = self.figure.subplots(1, 3, width_ratios=(1, 1, 0.9))
        self._stages = stages
        self.interval = 1000.0 * stages[0].frame_time
        """Milliseconds between frames."""
        self._frames = [
            (number, frame)
            for number, stage in enumerate(stages)
            for frame in range(stage.frames)
        ]
        self._now = -1
        self._moving: Any = None

    def animation(self) -> FuncAnimation:
        """The film for Matplotlib."""
        return FuncAnimation(
            self.figure,
            self._show,
            frames=len(self._frames),
            init_func=lambda: [],
            interval=self.interval,
        )

    def pictures(self) -> Iterator[Image.Image]:
        """The frames; what stands still in a stage is drawn once."""
        canvas: Any = self.figure.canvas
        ground, drawn = None, -1
        for number, frame in self._frames:
            artists = self._show_frame(number, frame)
            if number != drawn:
                for artist in artists:
                    artist.set_animated(True)
                canvas.draw()
                ground, drawn = canvas.copy_from_bbox(self.figure.bbox), number
            canvas.restore_region(ground)
            for artist in artists:
                artist.axes.draw_artist(artist)
            yield Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")

    def _show(self, at: int) -> list[Any]:
        return self._show_frame(*self._frames[at])

    def _show_frame(self, number: int, frame: int) -> list[Any]:
        """Show a frame of a stage; return the artists that move."""
        if number != self._now:
            with style.in_style():
                self._moving = draw_stage(self._panels, self._stages[number])
                style.keep_style(self.figure)
            if self._now < 0:  # the panels stay where they are, and frames are quick
                self.figure.draw_without_rendering()
                self.figure.set_layout_engine("none")
            self._now = number
        artists: list[Any] = self._moving(frame)
        return artists


def _gif(pictures: Iterator[Image.Image], interval: float) -> bytes:
    """A GIF in one palette, that of the last picture and of some before."""
    frames = list(pictures)
    few = frames[:: max(1, len(frames) // 6)] + frames[-1:]
    width, height = frames[0].size
    sample = Image.new("RGB", (width, height * len(few)))
    for place, frame in enumerate(few):
        sample.paste(frame, (0, place * height))
    palette = _with_white(sample.quantize(_COLOURS))
    first, *rest = (
        frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames
    )
    buffer = io.BytesIO()
    options = {"save_all": True, "append_images": rest, "loop": 0, "optimize": True}
    first.save(buffer, format="gif", duration=round(interval), **options)
    return buffer.getvalue()


def _with_white(image: Image.Image) -> Image.Image:
    """The palette with white itself, of which quantising makes a light grey."""
    colours = np.array(image.getpalette(), dtype=np.int64).reshape(-1, 3)
    colours[(colours >= _WHITE).all(axis=1)] = 255
    image.putpalette(colours.ravel().tolist())
    return image


def _mp4(film: _Film) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        film.animation().save(path, writer="ffmpeg", fps=round(1000.0 / film.interval))
        return path.read_bytes()


def _checked_path(path: Any) -> Path:
    target = validation.file_path("path", path)
    if target.suffix.lower() not in _KINDS:
        raise ValueError(
            f"path must end in {' or '.join(_KINDS)}, got {validation.shown(str(path))}; "
            "leave it out for an animation of Matplotlib, which saves other kinds."
        )
    if target.suffix.lower() == ".mp4" and not writers.is_available("ffmpeg"):
        raise RuntimeError(
            f"an .mp4 file needs ffmpeg, which is not installed; install it, or write "
            f"{target.with_suffix('.gif').name!r} instead of {target.name!r}."
        )
    if not target.absolute().parent.is_dir():
        raise ValueError(
            f"path must lie in a folder that exists, got {str(target)!r}; make "
            f"{str(target.parent)!r} first."
        )
    return checked_target(target)


def _checked_trials(agent: TabularAgent, trials: Any) -> list[int]:
    if trials is None:
        return [agent.trials] if agent.trials else list(SHOWN)
    if isinstance(trials, str) or not isinstance(trials, (Sequence, np.ndarray)):
        raise TypeError(
            f"trials must be a list of integers, got {validation.shown(trials)}."
        )
    checked = [
        validation.integer(f"trials[{i}]", trial, at_least=agent.trials)
        for i, trial in enumerate(trials)
    ]
    if not checked or any(b <= a for a, b in itertools.pairwise(checked)):
        raise ValueError(
            "trials must be one integer or more, increasing, got "
            f"{validation.shown(trials)}."
        )
    return checked
