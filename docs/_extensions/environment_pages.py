"""A page for each environment, in the form of Gymnasium's, from the class docstring.

The pages are written into docs/environments/generated before Sphinx reads the folder, so
that an environment that is registered has a page and a line in the table of all.
"""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path
from typing import Any

import gymnasium as gym
from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

from acl_gym.cli.envs import describe, parameters
from acl_gym.envs import ENVIRONMENTS

PICTURES = "figures/environments"


def setup(app: Sphinx) -> ExtensionMetadata:
    """Write the pages when the site is built."""
    names = {
        entry.single.partition(":")[2]: page_name(env_id)
        for env_id, entry in ENVIRONMENTS.items()
    }
    app.add_config_value("environment_pages", names, "env")
    app.connect("builder-inited", _write_pages)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def page_name(env_id: str) -> str:
    """The name of the page of an environment, `pendulum-v0` of `acl_gym/Pendulum-v0`."""
    return env_id.partition("/")[2].lower()


def _write_pages(app: Sphinx) -> None:
    folder = Path(app.srcdir) / "environments" / "generated"
    folder.mkdir(exist_ok=True)
    pages = {f"{page_name(env_id)}.md": page(env_id) for env_id in ENVIRONMENTS}
    pages["table.txt"] = table()
    for left in set(folder.iterdir()) - {folder / name for name in pages}:
        left.unlink()
    for name, text in pages.items():
        path = folder / name
        # A page that has not changed is not read again.
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def table() -> str:
    """All environments in a table, with the toctree of their pages."""
    rows = ["| | | Observations | Actions |", "| --- | --- | --- | --- |"]
    for env_id in ENVIRONMENTS:
        row = describe(env_id)
        name = page_name(env_id)
        rows.append(
            f"| ![A picture of {env_id}](../{PICTURES}/{name}.png){{width=8em}} "
            f"| [`{env_id}`](generated/{name}.md)<br>{row['description']} "
            f"| {row['observation']} | {row['actions']} |"
        )
    names = [f"generated/{page_name(env_id)}" for env_id in ENVIRONMENTS]
    return "\n".join([*rows, "", "```{toctree}", ":hidden:", "", *names, "```", ""])


def page(env_id: str) -> str:
    """The page of an environment."""
    entry = ENVIRONMENTS[env_id]
    single, vector = map(_load, (entry.single, entry.vector))
    summary, _, body = (inspect.getdoc(single) or "").partition("\n")
    name = env_id.partition("/")[2]
    picture = page_name(env_id)
    return "\n".join(
        [
            f"# {name.rpartition('-')[0]}",
            "",
            f"![{summary}](../../{PICTURES}/{picture}.png){{width=20em}}",
            "",
            summary,
            "",
            *_facts(env_id),
            "",
            _with_fenced_examples(body.strip()),
            "",
            *_parameters(env_id),
            "",
            *_classes(single, vector),
            "",
        ]
    )


def _facts(env_id: str) -> list[str]:
    env = gym.make(env_id)
    limit = ENVIRONMENTS[env_id].max_episode_steps
    facts = {
        "Action space": f"`{env.action_space}`",
        "Observation space": f"`{_one_line(env.observation_space)}`",
        "Time limit": f"{limit:,} steps",
        "One environment": f'`gym.make("{env_id}")`',
        "Many, in one kernel": f'`gym.make_vec("{env_id}", num_envs=100)`',
    }
    env.close()
    return [
        "| | |",
        "| --- | --- |",
        *(f"| {key} | {value} |" for key, value in facts.items()),
    ]


def _one_line(space: object) -> str:
    return " ".join(str(space).split())


def _with_fenced_examples(body: str) -> str:
    """The examples of a docstring as blocks of code, which Markdown writes with fences."""
    lines: list[str] = []
    inside = False
    for line in body.split("\n"):
        if line.startswith(">>> ") and not inside:
            lines.append("```pycon")
            inside = True
        elif inside and not line.strip():
            lines.append("```")
            inside = False
        lines.append(line)
    if inside:
        lines.append("```")
    return "\n".join(lines)


def _parameters(env_id: str) -> list[str]:
    system = _system(env_id)
    rows = parameters(system)
    if not rows:
        return []
    lines = [
        "## Parameters",
        "",
        "| Keyword | Default | Meaning |",
        "| --- | --- | --- |",
    ]
    for row in rows:
        meaning = " ".join(row["meaning"].split()).replace("|", "\\|")
        lines.append(f"| `{row['name']}` | `{row['default']!r}` | {meaning} |")
    return lines


def _system(env_id: str) -> type:
    system: type = _load(ENVIRONMENTS[env_id].single).system_type
    return system


def _classes(single: type, vector: type) -> list[str]:
    names = [f"{one.__module__}.{one.__name__}" for one in (single, vector)]
    return [
        "## Classes",
        "",
        *(f"- {{py:class}}`{name}`" for name in names),
    ]


def _load(path: str) -> Any:
    module, _, name = path.partition(":")
    return getattr(importlib.import_module(module), name)
