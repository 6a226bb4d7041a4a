"""Episodes of a policy in a window, or as a film."""

from __future__ import annotations

import io
import os
import sys
import tempfile
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from acl_gym.cli.common import check_name
from acl_gym.cli.environments import Environment
from acl_gym.cli.errors import BadArgumentError, bad_arguments
from acl_gym.utils.files import checked_target, write_atomically

FORMATS = (".gif", ".mp4")

FRAMES_PER_SECOND = 30
"""Where an environment does not say."""


def check(render: bool, video: Path | None) -> None:
    """Check before anything is evaluated that an episode can be shown.

    Raises:
        BadArgumentError: there is no display, a package is missing, or the film has
            another format.
    """
    if video is not None:
        check_name("the ending of --video", video.suffix.lower(), FORMATS)
        with bad_arguments():
            checked_target(video, "name a file elsewhere with --video FILE")
        if video.suffix.lower() == ".mp4" and find_spec("moviepy") is None:
            raise BadArgumentError(
                "--video FILE.mp4 needs moviepy, which is not installed; run `pip install "
                "moviepy`, or give the file a name that ends with .gif."
            )
    displays = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    if (
        render
        and sys.platform.startswith("linux")
        and not any(map(os.getenv, displays))
    ):
        raise BadArgumentError(
            "--render needs a display, and there is none here; write a film with --video "
            "FILE.gif."
        )


def play(
    agent: Any,
    environment: Environment,
    episodes: int,
    max_steps: int,
    seed: int,
    video: Path | None,
) -> None:
    """Show episodes in a window, or write them to one film.

    Args:
        agent: an agent, whose greedy policy is followed, or a policy.
        environment: where.
        episodes: how many; the first starts from a telling state in our systems, such
            as a pendulum at rest, the others from random ones.
        max_steps: the most steps of an episode.
        seed: of the first episode; the others follow it.
        video: the file; None shows a window.

    Raises:
        BadArgumentError: the environment cannot be drawn.
    """
    mode = "human" if video is None else "rgb_array"
    with bad_arguments():
        env = environment.single(mode)
    if env.render_mode != mode:
        raise BadArgumentError(
            f"{environment.name} cannot be drawn as {mode!r}; it knows "
            f"{env.metadata.get('render_modes') or 'no way of drawing'}."
        )
    try:
        frames = _frames(agent, env, episodes, max_steps, seed)
        if video is None:
            for _ in frames:
                pass  # the environment draws as it goes
        else:
            _write(video, frames, env.metadata.get("render_fps", FRAMES_PER_SECOND))
    except gym.error.DependencyNotInstalled as error:
        raise BadArgumentError(str(error)) from error
    except Exception as error:
        if type(error).__module__.partition(".")[0] != "pygame":
            raise
        raise BadArgumentError(
            f"no window can be opened ({error}); write a film with --video FILE.gif."
        ) from error
    finally:
        env.close()


def _frames(
    agent: Any, env: Any, episodes: int, max_steps: int, seed: int
) -> Iterator[Any]:
    """What the environment draws, step by step; None in a window."""
    for episode in range(episodes):
        options = _telling_start(env) if episode == 0 else None
        observation, info = env.reset(seed=seed + episode, options=options)
        yield env.render() if env.render_mode != "human" else None
        for _ in range(max_steps):
            mask = info.get("action_mask")
            masks = None if mask is None else np.asarray(mask, dtype=np.bool_)[None]
            allowed = {} if masks is None else {"action_masks": masks}
            actions, _ = agent.predict(np.asarray(observation)[None], **allowed)
            observation, _, terminated, truncated, info = env.step(actions[0])
            yield env.render() if env.render_mode != "human" else None
            if terminated or truncated:
                break


def _telling_start(env: Any) -> dict[str, Any] | None:
    """Where the first episode begins in our systems: a pendulum hangs at rest."""
    from acl_gym.envs.control.single import ControlEnv

    if not isinstance(env.unwrapped, ControlEnv):
        return None
    from acl_gym.plotting.trajectories import start_of

    return {"state": start_of(env.unwrapped.system)}


def _write(path: Path, frames: Iterator[Any], fps: float) -> None:
    """Write a film; Pillow, which Matplotlib needs, makes .gif files."""
    if path.suffix.lower() == ".mp4":
        clip = import_module("moviepy").ImageSequenceClip(list(frames), fps=fps)
        # MoviePy writes into the file as it goes, and by the ending it knows the format.
        with tempfile.TemporaryDirectory() as folder:
            film = Path(folder) / "film.mp4"
            clip.write_videofile(str(film), logger=None)
            write_atomically(path, film.read_bytes())
        return
    from PIL import Image

    images = (Image.fromarray(frame) for frame in frames)
    first, buffer = next(images), io.BytesIO()
    first.save(
        buffer,
        format="GIF",
        save_all=True,
        append_images=images,
        duration=max(20, round(1000 / fps)),  # viewers slow down what is faster
        loop=0,
    )
    write_atomically(path, buffer.getvalue())
