"""What `acl-gym train --help` says."""

from __future__ import annotations

import textwrap
from typing import Any

from acl_gym.cli.agents import AGENTS, parameters
from acl_gym.cli.errors import Command

HELP = """Learn in an environment, print the progress, and save the agent.

The agent is the returning colony: its ants walk back and remember, and its partition is
chosen automatically and grows. --agent acl is the colony of the thesis, --agent q-learning is
Q-learning and Q(lambda); --agent ant-system, ant-colony-system and max-min look for one
best solution, such as a shortest tour, where states are numbered. Without --agent, a
parameter may choose: --param deposit=rank:5 takes the colony of the thesis, the first
that has deposits.

ENV_ID is the id of any Gymnasium environment; "module:id" imports a module first, which
may be in the working directory. Two files are written: NAME.npz, the agent as it is at
the end, and NAME-best.npz, as it was when its policy was the best.

Ctrl-C, and SIGTERM, end learning after the trial under way (or at once if that takes
more than two seconds) and save the agent; --resume goes on from there as if nothing had
happened. The exit code is then 130, or 143. A second Ctrl-C ends the program at once.

Where steps are expensive, --interactions N makes only N of them: they are recorded, a
model is fitted to them, the ants learn in the model, and their policy makes the next
steps. Each step is written to the folder NAME-plant at once; after a run that was
killed, the same command continues it. --from-data FILE learns from what was recorded before, alone or
before --interactions. Goal and cost are those of the environment, or else are learned
from rewards and terminations.

\b
Examples:
  acl-gym train acl_gym/Pendulum-v0
  acl-gym train acl_gym/Pendulum-v0 --interactions 200 --restart-after 10
  acl-gym train acl_gym/Pendulum-v0 --from-data recorded.npz
  acl-gym train acl_gym/Pendulum-v0 --from-data log.csv --state a,b --input u
  acl-gym train Pendulum-v1 --from-data log.csv --state cos,sin,omega \\
      --input u --reward r
  acl-gym train --resume Pendulum-v0.npz --trials 50            50 more trials
  acl-gym train acl_gym/Pendulum-v0 --agent acl --ants 2000 --seed 3
  acl-gym train acl_gym/GridSearch2D-v0 --param epsilon=0.2
  acl-gym train acl_gym/GridSearch2D-v0 --ants 86 --param tabu=true
  acl-gym train acl_gym/Pendulum-v0 --agent q-learning --param trace_decay=0.5
  acl-gym train acl_gym/Pendulum-v0 --partition crisp --param tau0=0.001
  acl-gym train acl_gym/Pendulum-v0 --param epsilon=linear:0.3:0.01:50
  acl-gym train acl_gym/Pendulum-v0 --env-arg torques=[-1,0,1] --cells 64,65
  acl-gym train CartPole-v1 --param deposit=rank:5
  acl-gym train acl_gym/TravellingSalesman-v0 --agent max-min
  acl-gym train Pendulum-v1 --discretize 5
  acl-gym train my_module:MyEnv-v0 --max-steps 200 --log run.csv --json
"""


class TrainCommand(Command):
    """Its help lists the parameters of the agents, which are looked up only then."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        from acl_gym.cli.settings import OBJECTS, SCHEDULES, signature

        blocks = []
        for name in AGENTS:
            lines = [
                textwrap.fill(
                    f"{each:14} {declared.default}  {declared.words}",
                    78,
                    initial_indent="  ",
                    subsequent_indent=" " * 17,
                )
                for each, declared in parameters(name).items()
            ]
            blocks += [f"Parameters of --agent {name} with their defaults:", *lines, ""]
        families = {"a number that changes (schedule)": SCHEDULES, **OBJECTS}
        for title, kinds in families.items():
            blocks.append(f"Values for {title}:")
            blocks += [f"  {signature(name, kind)}" for name, kind in kinds.items()]
            blocks.append("")
        blocks.append("Costs add up: settling_time:0:3.14+2*overshoot:0:3.14+0.1")
        self.epilog = "\b\n" + "\n\n\b\n".join("\n".join(blocks).split("\n\n"))
        super().format_help(ctx, formatter)
