"""Rollouts on Ray: the local engine's results, whatever is killed on the way."""

import contextlib
import os
import re
import signal
import time

import pytest

import fg_mujoco as fg
from fg_mujoco.cli.main import main
from fg_mujoco.errors import ControllerError, EngineError

pytestmark = pytest.mark.slow

WORLDS = {"n": 12, "randomize": {"mu": (0.6, 1.2), "start_s": (0.0, 50.0)}, "time_limit": 0.6}
RAY = fg.Executor(kind="ray", chunk=2)
PLANNER = """
import os, time
from pathlib import Path
from fg_mujoco.messages import DriveCommand
MARKS = Path({marks!r})
class Planner:
    def __init__(self, mu, max_speed):
        self.speed = min(mu, 1.0)
    def reset(self):
        {reset}
    def __call__(self, scan, odometry):
        {call}
        return DriveCommand(steering_angle=0.3 * float(scan.bearings[scan.ranges.argmax()]), speed=self.speed)
"""
FAST_DEATH = {  # nodes that are gone are missed within seconds
    "health_check_initial_delay_ms": 0,
    "health_check_period_ms": 500,
    "health_check_timeout_ms": 1000,
    "health_check_failure_threshold": 3,
}


@pytest.fixture(scope="module")
def ray():
    os.environ |= {"RAY_USAGE_STATS_ENABLED": "0", "RAY_enable_worker_prestart": "0"}
    return pytest.importorskip("ray", reason="the extra `cluster` is not installed: pip install -e '.[cluster]'")


@pytest.fixture(scope="module")
def two_nodes(ray):
    """A local cluster of two nodes with one core each; the last test kills the second."""
    from ray.cluster_utils import Cluster

    bare = {"num_cpus": 1, "include_log_monitor": False, "no_monitor": True}
    head = {**bare, "include_dashboard": False, "_system_config": FAST_DEATH}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    cluster.second = cluster.add_node(**bare)
    cluster.wait_for_nodes()
    ray.init(address=cluster.address, log_to_driver=False)
    yield cluster
    ray.shutdown()
    cluster.shutdown()


@pytest.fixture
def planner(tmp_path):
    """Write a planner that marks what it does in files."""
    (tmp_path / "marks").mkdir()

    def write(reset="pass", call="pass"):
        (tmp_path / "mine.py").write_text(PLANNER.format(marks=str(tmp_path / "marks"), reset=reset, call=call))
        return f"{tmp_path / 'mine.py'}:Planner"

    return write


def marks(tmp_path):
    return sorted(path.name for path in (tmp_path / "marks").iterdir())


def assert_same(result, local):
    assert result.worlds.tobytes() == local.worlds.tobytes()
    assert result.lap_times_s.tobytes() == local.lap_times_s.tobytes()


def test_without_a_cluster_the_command_starts_its_own_and_stops_it(ray, here, monkeypatch, capfd):
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    arguments = ["--n", "8", "--time-limit", "0.5", "--workers", "1", "--executor", "ray", "--out", "ray"]
    assert main(["rollout", *arguments]) == 0
    out, err = capfd.readouterr()
    # a cluster that takes a minute to start is told of once a minute, in a pipe, too
    assert [line for line in err.splitlines() if not re.match(r"fg-mujoco: \d/8 worlds", line)] == []
    assert "8: 8 time limit" in out
    assert_same(fg.read_rollout("ray"), fg.rollout("oval", n=8, time_limit=0.5))
    assert not ray.is_initialized()


# -- on one cluster, which is up from here on


def test_a_cluster_that_exists_is_used_and_left_as_it_is(ray, two_nodes, planner, tmp_path, monkeypatch):
    expected = fg.rollout(["oval", "tight"], record="states", **WORLDS)
    result = fg.rollout(["oval", "tight"], record="states", executor=RAY, **WORLDS)
    assert_same(result, expected)
    for world in range(WORLDS["n"]):
        assert result.telemetry(world).tobytes() == expected.telemetry(world).tobytes()
        assert result.states(world).tobytes() == expected.states(world).tobytes()
        assert result.ctrl(world).tobytes() == expected.ctrl(world).tobytes()
    assert ray.is_initialized()

    # a worker that dies, once, in the middle of a chunk
    source = planner(reset="(MARKS / 'dead').exists() or ((MARKS / 'dead').touch(), os.kill(os.getpid(), 9))")
    result = fg.rollout("oval", source, executor=RAY, **WORLDS)
    assert marks(tmp_path) == ["dead"]
    assert_same(result, fg.rollout("oval", source, **WORLDS))

    # a planner that raises ends its worlds, not the rollout; one that cannot be built is refused
    failing = planner(call="raise ValueError('lost')")
    assert set(fg.rollout("oval", failing, executor="ray", n=2, time_limit=0.1)["end_reason"]) == {"planner_failed"}
    with pytest.raises(ControllerError, match="nobody"):
        fg.rollout("oval", "nobody", executor="ray", n=2)

    # a chunk that kills its worker every time it is driven
    monkeypatch.setattr("fg_mujoco.addons.learn.ray_cluster.RETRIES", 0)
    with pytest.raises(EngineError, match="lost more than 0 times"):
        fg.rollout("oval", planner(reset="os.kill(os.getpid(), 9)"), executor="ray", n=1, time_limit=0.5)


def test_a_node_that_is_killed_half_way_costs_its_chunk_only(two_nodes, planner, tmp_path):
    # each world says on which node it begins; a chunk takes a second or so, most of it in the planner
    begin = "import ray; node = ray.get_runtime_context().get_node_id() if ray.is_initialized() else 'local'; "
    begin += "(MARKS / f'{node}-{os.getpid()}-{time.monotonic_ns()}').touch()"
    source = planner(reset=begin, call="time.sleep(0.01)")
    second = two_nodes.second.node_id
    killed = []

    def watch(progress):
        on_second = [mark.split("-")[1:] for mark in marks(tmp_path) if mark.startswith(second)]
        just_begun = [pid for pid, begun in on_second if time.monotonic_ns() - int(begun) < 300_000_000]
        if not killed and progress.worlds_driven >= 2 and just_begun:
            two_nodes.remove_node(two_nodes.second, allow_graceful=False)
            for pid in {int(pid) for pid, _ in on_second}:  # with the node goes what runs on it
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            killed.append(progress.worlds_driven)

    result = fg.rollout("oval", source, executor=RAY, watch=watch, out=tmp_path / "out", **WORLDS)
    assert killed
    assert killed[0] < WORLDS["n"]
    begun = marks(tmp_path)
    assert WORLDS["n"] < len(begun) <= WORLDS["n"] + 3 * RAY.chunk  # what was lost was begun again, no more
    assert result.worlds_driven == WORLDS["n"]
    assert_same(result, fg.rollout("oval", source, **WORLDS))
    assert_same(fg.read_rollout(tmp_path / "out"), result)
