"""Workers step the slots: the same bits from any number of them, whatever happens."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.vector import SyncVectorEnv, VectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from acl_gym import QLearning, ReturningACL, WaitingVectorEnv, WorkersVectorEnv
from acl_gym.envs.wrappers.workers import WorkerDiedError, spread_over_workers
from tests.envs.wrappers.wanderers import (
    MAKERS,
    SLOTS,
    FromElsewhere,
    Locked,
    OldFashioned,
    Once,
    Shapeless,
    Wanderer,
    Wide,
    be_picky,
    break_down,
    kill_myself,
)


def walked(env: VectorEnv, between: Callable[[dict], None] | None = None, **how: Any):
    """The bits of 12 steps of every slot; `between` sees the infos after the fourth."""
    observation, infos = env.reset(**how)
    bits = [observation.tobytes(), infos["action_mask"].tobytes()]
    for time_step in range(12):
        *arrays, infos = env.step(np.arange(env.num_envs) % 3)
        bits += [array.tobytes() for array in arrays]
        if "action_mask" in infos:
            bits.append(infos["action_mask"].tobytes())
        if time_step == 3 and between is not None:
            between(infos)
    return bits


@pytest.fixture(scope="module")
def env() -> Iterator[WorkersVectorEnv]:
    """Two processes, which the tests share: to start one takes about a second."""
    env = WorkersVectorEnv(MAKERS, workers=2)
    yield env
    env.close()


@pytest.fixture(scope="module")
def here() -> WorkersVectorEnv:
    return WorkersVectorEnv(MAKERS, workers=0)


# --- The same bits -------------------------------------------------------------


def test_any_number_of_workers_gives_the_bits_of_a_waiting_vector_env(
    env: WorkersVectorEnv,
) -> None:
    expected = walked(WaitingVectorEnv(MAKERS), seed=7)
    assert walked(env, seed=7) == expected
    for workers in (0, 1, 3):
        other = WorkersVectorEnv(MAKERS, workers=workers)
        assert walked(other, seed=7) == expected
        other.close()


def test_episodes_without_a_seed_of_their_own_are_the_same_as_well(
    env: WorkersVectorEnv, here: WorkersVectorEnv
) -> None:
    seen = []
    for each in (env, here):
        each.reset(seed=3)
        own = [walked(each), walked(each)]
        mask = np.array([True, False, True, False, False])
        own.append(walked(each, options={"reset_mask": mask}))
        own.append(walked(each, seed=[5, None, 7, None, 9]))
        assert own[0] != own[1]
        seen.append(own)
    assert seen[0] == seen[1]
    # Neighbouring seeds share no later episodes, though they share first ones.
    here.reset(seed=4)
    assert here.reset()[0][0].tolist() not in [
        (here.reset(seed=3), here.reset())[1][0][1].tolist()
    ]


@pytest.mark.parametrize("kind", [ReturningACL, QLearning])
def test_agents_learn_the_same(kind: Any, env: WorkersVectorEnv, here: Any) -> None:
    tables = []
    for each in (WaitingVectorEnv(MAKERS), here, env):
        agent = kind(each, seed=2, max_steps=20).learn(trials=3)
        assert agent.num_timesteps > 0
        tables.append(agent.table.tobytes())
    assert len(set(tables)) == 1


def test_a_colony_spreads_its_environment(tmp_path: Path) -> None:
    plain = WaitingVectorEnv.make("FrozenLake-v1", 6)
    expected = ReturningACL(plain, seed=1).learn(trials=4)
    for workers in (0, 4):
        colony = ReturningACL(plain, seed=1, workers=workers)
        assert isinstance(colony.env, WorkersVectorEnv)
        assert colony.learn(trials=4).table.tobytes() == expected.table.tobytes()
        colony.env.close()
    colony.save(tmp_path / "colony")
    again = ReturningACL.load(tmp_path / "colony", plain)
    assert again.env is plain
    assert again.learn(trials=1).trials == 5


def test_what_an_environment_is_known_by_comes_from_the_worker() -> None:
    native = gym.make_vec("acl_gym/Pendulum-v0", num_envs=3, autoreset_mode="SameStep")
    colony = ReturningACL(native, seed=0, workers=1)
    assert colony.max_steps == 300
    assert "circular=[0]" in repr(colony.partition)
    colony.env.close()


def test_frames_come_from_the_workers(env: WorkersVectorEnv) -> None:
    env.reset(seed=0)
    env.step(np.zeros(SLOTS, np.int64))
    assert env.metadata["render_fps"] == 5
    frames = env.render()
    assert [frame.shape for frame in frames] == [(2, 2, 3)] * SLOTS
    assert [frame.max() for frame in frames] == [1] * SLOTS


def test_ids_registered_here_are_known_to_workers() -> None:
    gym.register("Wanderer-v0", entry_point=Wanderer, kwargs={"number": 0})
    try:
        sync = gym.make_vec("Wanderer-v0", num_envs=2, vectorization_mode="sync")
        other = spread_over_workers(sync, 1)
    finally:
        del gym.registry["Wanderer-v0"]
    assert walked(other, seed=1) == walked(WaitingVectorEnv([MAKERS[0]] * 2), seed=1)
    other.close()


def test_dict_and_tuple_observations() -> None:
    class Structured(gym.Env):
        observation_space = gym.spaces.Dict(
            both=gym.spaces.Tuple([gym.spaces.Discrete(9), gym.spaces.MultiBinary(2)]),
            place=gym.spaces.Box(-1, 1, (2,), np.float32),
        )
        action_space = gym.spaces.Discrete(2)

        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            self.time = 0
            return self.seen(), {}

        def step(self, action):
            self.time += 1
            return self.seen(), 1.0, self.time == 3, False, {}

        def seen(self):
            sides = np.array([self.time % 2, 1], np.int8)
            return {
                "both": (self.time, sides),
                "place": self.np_random.uniform(-1, 1, 2).astype(np.float32),
            }

    found = []
    for each in (
        SyncVectorEnv([Structured] * 3),
        WaitingVectorEnv([Structured] * 3),
        WorkersVectorEnv([Structured] * 3, workers=1),
    ):
        each.reset(seed=1)
        for _ in range(2):
            observation = each.step(np.zeros(3, np.int64))[0]
        found.append(observation)
        each.close()
    for other in found[1:]:
        assert other["both"][0].tolist() == found[0]["both"][0].tolist() == [2, 2, 2]
        assert other["both"][1].tolist() == found[0]["both"][1].tolist()
        assert other["place"].tobytes() == found[0]["place"].tobytes()


# --- Workers die ---------------------------------------------------------------


@pytest.mark.parametrize("how", [kill_myself, partial(os._exit, 3)])
def test_what_a_worker_that_died_has_done_is_repeated(
    how: Callable[[], Any],
    env: WorkersVectorEnv,
    here: WorkersVectorEnv,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO, logger="acl_gym")
    fault = Once(tmp_path / "marker", how)
    assert walked(env, seed=5, options={"fault": fault}) == walked(here, seed=5)
    assert fault.marker.exists()
    (message,) = [record.message for record in caplog.records]
    reason = "was killed by SIGKILL" if how is kill_myself else "exit code 3"
    assert message.startswith("worker 0, which has slots 0 to 1,")
    assert reason in message


def test_a_worker_killed_between_steps_is_replaced_at_the_next(
    env: WorkersVectorEnv, here: WorkersVectorEnv
) -> None:
    def kill(infos: dict) -> None:
        for pid in set(infos["pid"][infos["_pid"]].tolist()):
            os.kill(pid, signal.SIGKILL)

    assert walked(env, kill, seed=6) == walked(here, seed=6)


def test_a_worker_that_dies_again_and_again_is_given_up(
    env: WorkersVectorEnv, here: WorkersVectorEnv
) -> None:
    env.reset(seed=0, options={"fault": partial(os._exit, 3)})
    for _ in range(2):
        env.step(np.zeros(SLOTS, np.int64))
    with pytest.raises(WorkerDiedError, match=r"exit code 3.* 3 in a row") as caught:
        env.step(np.zeros(SLOTS, np.int64))
    assert "slots 0 to 1" in str(caught.value)
    assert walked(env, seed=1) == walked(here, seed=1)


def test_a_worker_that_does_not_answer_is_replaced(
    here: WorkersVectorEnv, tmp_path: Path
) -> None:
    env = WorkersVectorEnv(MAKERS[:2], workers=1, timeout=2.0)
    fault = Once(tmp_path / "marker", partial(time.sleep, 600))
    started = time.monotonic()
    found = walked(env, seed=5, options={"fault": fault})
    assert 2.0 < time.monotonic() - started < 60.0
    assert found == walked(WaitingVectorEnv(MAKERS[:2]), seed=5)
    env.close()


def test_an_episode_that_cannot_be_repeated_ends_where_it_was() -> None:
    env = WorkersVectorEnv([FromElsewhere] * 2, workers=1)
    _, infos = env.reset(seed=0)
    before = env.step(np.zeros(2, np.int64))[0]
    os.kill(int(infos["pid"][0]), signal.SIGKILL)
    with pytest.warns(
        RuntimeWarning, match=r"slot [01] was repeated .* another observation"
    ):
        after, rewards, terminated, truncated, _ = env.step(np.zeros(2, np.int64))
    assert np.array_equal(after, before)
    assert rewards.tolist() == [0.0, 0.0]
    assert truncated.all()
    assert not terminated.any()
    env.reset()
    assert env.step(np.zeros(2, np.int64))[1].tolist() == [1.0, 1.0]
    env.close()


# --- Environments fail ---------------------------------------------------------


@pytest.mark.parametrize("where", ["env", "here"])
def test_an_exception_of_an_environment_is_raised_here(
    where: str,
    env: WorkersVectorEnv,
    here: WorkersVectorEnv,
    tmp_path: Path,
    request: pytest.FixtureRequest,
) -> None:
    """And the walk can go on after it as if nothing had been."""
    each = request.getfixturevalue(where)
    here.reset(seed=4)
    actions = np.arange(SLOTS) % 3
    expected = [part.tobytes() for _ in range(12) for part in here.step(actions)[:4]]
    each.reset(seed=4, options={"fault": Once(tmp_path / "marker", break_down)})
    bits = [part.tobytes() for _ in range(2) for part in each.step(actions)[:4]]
    with pytest.raises(ZeroDivisionError, match="the pole is broken") as caught:
        each.step(actions)
    assert caught.value.__notes__ == ["It comes from the environment of slot 1."]
    assert where == "here" or "in break_down" in str(caught.value.__cause__)
    bits += [part.tobytes() for _ in range(10) for part in each.step(actions)[:4]]
    assert bits == expected


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (be_picky, "Picky: 1 is not 2"),
        (partial(sys.exit, "enough"), r"sys\.exit\('enough'\)"),
    ],
)
def test_exceptions_that_cannot_be_raised_here_are_told(
    fault: Callable[[], Any], message: str, env: WorkersVectorEnv
) -> None:
    env.reset(seed=0, options={"fault": fault})
    for _ in range(2):
        env.step(np.zeros(SLOTS, np.int64))
    with pytest.raises(RuntimeError, match=message):
        env.step(np.zeros(SLOTS, np.int64))


def test_what_environments_return_is_checked() -> None:
    env = WorkersVectorEnv([partial(Locked, 0)], workers=1)
    with pytest.raises(TypeError, match=r"sent to another process.*lock"):
        env.reset()
    env.close()
    for make in (WaitingVectorEnv, partial(WorkersVectorEnv, workers=0)):
        env = make([*MAKERS[:2], partial(Shapeless, 2)])
        env.reset(seed=0)
        with pytest.raises(ValueError, match=r"slot 2 must have shape \(2,\)"):
            env.step(np.zeros(3, np.int64))
        env = make([partial(OldFashioned, 0)])
        env.reset(seed=0)
        with pytest.raises(ValueError, match=r"step .* tuple of 5 parts"):
            env.step(np.zeros(1, np.int64))
    with pytest.raises(ValueError, match=r"same observation space.* in slot 2 and"):
        WorkersVectorEnv([*MAKERS[:2], partial(Wide, 2)], workers=0)
    with pytest.raises(ValueError, match=r"same observation space.* in slot 1 and"):
        WorkersVectorEnv([MAKERS[0], partial(Wide, 1)], workers=2)


def test_bad_arguments_are_refused(here: WorkersVectorEnv) -> None:
    lock = threading.Lock()
    for arguments, error, message in [
        (([],), ValueError, "at least one environment"),
        (([Wanderer(0)],), TypeError, "functions that make environments"),
        ((MAKERS, -1), ValueError, "workers must be at least 0"),
        ((MAKERS, "two"), TypeError, "workers must be an integer"),
        ((MAKERS, 2, "threads"), ValueError, "executor must be one of 'processes'"),
        (([lambda: lock],), TypeError, r"sent to another process.*lock"),
    ]:
        with pytest.raises(error, match=message):
            WorkersVectorEnv(*arguments)
    with pytest.raises(ValueError, match="timeout"):
        WorkersVectorEnv(MAKERS, timeout=0)
    fresh = WorkersVectorEnv(MAKERS, workers=0)
    with pytest.raises(ResetNeeded, match="call reset"):
        fresh.step(np.zeros(SLOTS, np.int64))
    here.reset(seed=0)
    with pytest.raises(ValueError, match="actions must be 5, one for each slot, got 2"):
        here.step(np.zeros(2, np.int64))
    with pytest.raises(ValueError, match="one for each of the 5 slots, got 2"):
        here.reset(seed=[1, 2])
    with pytest.raises(ValueError, match="reset_mask"):
        here.reset(options={"reset_mask": np.zeros(SLOTS, np.bool_)})


def test_only_environments_that_can_be_made_anew_are_spread() -> None:
    with pytest.raises(TypeError, match=r"must be a gymnasium\.vector\.VectorEnv"):
        ReturningACL(gym.make("FrozenLake-v1"), workers=2)
    wrapped = RecordEpisodeStatistics(gym.make_vec("CartPole-v1", num_envs=2))
    with pytest.raises(ValueError, match=r"without vector wrappers.*WorkersVectorEnv"):
        ReturningACL(wrapped, workers=2)
    with pytest.raises(ValueError, match=r"executor.*'ray' without workers"):
        ReturningACL(gym.make_vec("CartPole-v1", num_envs=2), executor="ray")


# --- The end -------------------------------------------------------------------


def test_closed_twice_and_used_after_it() -> None:
    env = WorkersVectorEnv(MAKERS[:2], workers=1)
    pid = int(env.reset(seed=0)[1]["pid"][0])
    env.close()
    env.close()
    assert not alive(pid)
    with pytest.raises(ClosedEnvironmentError, match="was closed"):
        env.step(np.zeros(2, np.int64))


def alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


SCRIPT = textwrap.dedent(
    """
    import os, signal, sys, time
    import gymnasium as gym
    import numpy as np
    from acl_gym import WorkersVectorEnv

    # What a shell starts in the background inherits that interrupts are ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)

    class Slow(gym.Env):
        observation_space = gym.spaces.Discrete(2)
        action_space = gym.spaces.Discrete(2)

        def reset(self, *, seed=None, options=None):
            return 0, {"pid": os.getpid()}

        def step(self, action):
            if action:
                os.write(1, b"asleep\\n")
                time.sleep(600)
            return 0, 0.0, False, False, {}

        def close(self):
            os.write(1, b"shut\\n")  # as a whole, while others write as well

    env = WorkersVectorEnv([Slow] * 2, workers=2)
    pids = env.reset()[1]["pid"]
    print(*pids, flush=True)
    try:
        env.step(np.array([0, int(sys.argv[1])]))
    except KeyboardInterrupt:
        env.step(np.array([0, 0]))
        env.close()
        print("closed", flush=True)
    """
)


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize("ending", [signal.SIGKILL, signal.SIGINT, None])
def test_no_worker_outlives_its_parent(
    ending: signal.Signals | None, tmp_path: Path
) -> None:
    """Killed, interrupted, or at its end; the script has no guard of `__main__`."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    parent = subprocess.Popen(
        [sys.executable, script, str(int(ending is not None))],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    pids = [int(pid) for pid in parent.stdout.readline().split()]
    assert len(pids) == 2
    if ending is not None:
        assert all(map(alive, pids))
        assert parent.stdout.readline() == "asleep\n"
        time.sleep(0.2)  # now it is
        # As a terminal does, which interrupts all processes.
        os.kill(-parent.pid if ending is signal.SIGINT else parent.pid, ending)
    said, complaints = parent.communicate(timeout=60)
    if ending is not signal.SIGKILL:
        shut = ["shut", "shut"]
        assert said.split() == ([*shut, "closed"] if ending else shut), complaints
        assert complaints == ""
        assert parent.returncode == 0
    deadline = time.monotonic() + 20
    while any(map(alive, pids)) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not any(map(alive, pids))


# --- Ray -----------------------------------------------------------------------


def test_without_ray_the_error_says_how_to_install_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'acl-gym\[cluster\]'"):
        WorkersVectorEnv(MAKERS, workers=2, executor="ray")


@pytest.fixture
def cluster() -> Iterator[Any]:
    ray = pytest.importorskip("ray")
    ray.init(
        num_cpus=2,
        include_dashboard=False,
        log_to_driver=False,
        logging_level=logging.ERROR,
    )
    yield ray
    ray.shutdown()


@pytest.mark.filterwarnings("default")  # Ray's own
@pytest.mark.usefixtures("cluster")
def test_a_cluster_gives_the_same_bits(here: WorkersVectorEnv, tmp_path: Path) -> None:
    """Also where an actor dies, and where an environment fails."""
    env = WorkersVectorEnv(MAKERS, workers=3, executor="ray")
    assert walked(env, seed=7) == walked(here, seed=7)
    fault = Once(tmp_path / "marker", kill_myself)
    assert walked(env, seed=5, options={"fault": fault}) == walked(here, seed=5)
    assert fault.marker.exists()
    env.reset(seed=0, options={"fault": break_down})
    for _ in range(2):
        env.step(np.zeros(SLOTS, np.int64))
    with pytest.raises(ZeroDivisionError, match="the pole is broken") as caught:
        env.step(np.zeros(SLOTS, np.int64))
    assert "in break_down" in str(caught.value.__cause__)
    tables = [
        ReturningACL(each, seed=2, max_steps=20).learn(trials=2).table.tobytes()
        for each in (env, here)
    ]
    assert tables[0] == tables[1]
    pids = env.reset()[1]["pid"].tolist()
    env.close()
    deadline = time.monotonic() + 20
    while any(map(alive, pids)) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not any(map(alive, pids))


def test_workers_do_not_wait_for_kernels() -> None:
    """What a new process imports that is to host environments of others."""
    program = (
        "import sys, acl_gym.envs.wrappers.hosting; sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
