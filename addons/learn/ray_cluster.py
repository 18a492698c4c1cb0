"""Drives the chunks of a rollout as tasks of Ray: on a cluster that exists, or on one of this machine's own.

Ray decides where a chunk is driven, and drives it again when its worker or its whole node is lost. The results are
those of threads here, bit for bit: each task runs the same function in one thread, and a node whose versions differ is
refused.
"""

from __future__ import annotations

import importlib
import importlib.util
import logging
import os
import socket
import tempfile
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from fg_mujoco.errors import ControllerError, EngineError, FgMujocoError, missing_extra
from fg_mujoco.racing.planner_origin import changed_file
from fg_mujoco.racing.planners import file_in, moved_to
from fg_mujoco.rollouts.job import Arrays, RolloutJob, versions
from fg_mujoco.rollouts.workers import completed, usable_cores

RETRIES = 5
"""Number of times that a chunk is driven again after its worker was lost."""

_KNOCK = 10.0  # [s] for a cluster to answer
_LAST: dict[str, RolloutJob] = {}  # of a worker, by its rollout: the job that a task brings has no worlds yet
_AHEAD = 2  # chunks submitted for each core of the cluster: what is finished and not yet fetched stays bounded


def drive_on_ray(
    job: RolloutJob, chunks: Sequence[int], *, workers: int | None, pulse: Callable[[float], None]
) -> Generator[tuple[int, Arrays], None, None]:
    """Do as `drive_in_processes`, on a cluster.

    Args:
      job: the rollout.
      chunks: their numbers.
      workers: most chunks at a time, and cores of a cluster of this machine's own; None: as many as there are.
      pulse: gets 0.

    Raises:
      MissingExtraError: Ray is not installed.
      EngineError: a cluster that cannot be reached, that has other versions, or that loses a chunk again and again.
    """
    require_one_file(job)
    ray, running = require_ray(), dict[int, Any]()
    with _cluster(ray, workers):
        task = ray.remote(num_cpus=1, max_retries=RETRIES)(_drive)
        shared, name, text, here = ray.put(job), uuid4().hex, job.controller_text, versions()

        def start(number: int) -> Future[Arrays]:
            running[number] = task.remote(shared, name, number, text, here)
            future: Future[Arrays] = running[number].future()
            return future

        def room() -> int:
            return workers or _AHEAD * int(ray.cluster_resources().get("CPU", 1))

        try:
            for number, future in completed(start, chunks, room=room, pulse=lambda: pulse(0.0)):
                del running[number]
                yield number, _fetch(ray, future)
        finally:
            for reference in running.values():
                ray.cancel(reference)


def require_one_file(job: RolloutJob) -> None:
    """Refuse a controller of several files: a cluster is sent one.

    Raises:
      ControllerError: it is a launch file, or a node that imports modules of the user's own.
    """
    path = file_in(job.controller)
    if path is not None and job.controller_text != path.read_bytes():
        raise ControllerError(
            f"controller {job.controller!r} has several files; accepted on a Ray cluster: a node of one file"
        )


def _drive(
    job: RolloutJob, rollout: str, number: int, controller_text: bytes | None, expected: dict[str, str]
) -> Arrays:
    """Drive a chunk of a rollout that has a name; this runs on a worker."""
    if versions() != expected:
        differing = [f"{name} {versions()[name]}" for name in expected if versions()[name] != expected[name]]
        raise EngineError(f"a node of the cluster has {', '.join(differing)}; accepted: the same as where it started")
    changed = changed_file(job.files)
    if changed is not None:
        said = f"a node of the cluster: planner {job.controller!r}: {changed}"
        raise ControllerError(f"{said}; accepted: the same file on each node, at the same path")
    if rollout not in _LAST:
        _LAST.clear()
        _LAST[rollout] = job
    job = _LAST[rollout]
    if controller_text is None:
        return job.drive(number)
    source = file_in(job.controller)
    assert source is not None
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / source.name
        file.write_bytes(controller_text)
        return job.drive(number, controller=moved_to(job.controller, file))


def _fetch(ray: Any, future: Future[Arrays]) -> Arrays:
    try:
        arrays = future.result()
    except ray.exceptions.RayTaskError as error:
        if isinstance(error.cause, FgMujocoError):
            raise error.cause from None
        raise EngineError(f"a chunk failed on the cluster: {_last_line(error)}") from error
    except ray.exceptions.RayError as error:
        raise EngineError(f"a chunk was lost more than {RETRIES} times: {_last_line(error)}") from error
    return {name: np.array(values) for name, values in arrays.items()}  # ray's own are views of its store


@contextmanager
def _cluster(ray: Any, workers: int | None) -> Iterator[None]:
    """Connect to the cluster that there is, else start one here; leave things as they were in the end."""
    if ray.is_initialized():
        yield
        return
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    quiet = {"log_to_driver": False, "logging_level": logging.ERROR}
    logging.getLogger("ray").setLevel(logging.ERROR)  # it speaks before it reads its options
    address = os.environ.get("RAY_ADDRESS", "")
    try:
        _knock(address)
        try:
            ray.init(address="auto", **quiet)  # $RAY_ADDRESS, or one that runs on this machine
        except ConnectionError:
            if address:
                raise
            ray.init(address="local", num_cpus=workers or usable_cores(), include_dashboard=False, **quiet)
    except Exception as error:
        where = address or "this machine"
        raise EngineError(f"no cluster at {where}: {_last_line(error)}; accepted: RAY_ADDRESS of one") from error
    try:
        yield
    finally:
        ray.shutdown()


def _knock(address: str) -> None:
    """Raise OSError where nobody listens at HOST:PORT: Ray itself would try for minutes."""
    host, _, port = address.rpartition(":")
    if host and port.isdigit() and "//" not in address:
        socket.create_connection((host, int(port)), timeout=_KNOCK).close()


def require_ray() -> Any:
    """Return Ray.

    Raises:
      MissingExtraError: it is not installed; the message has the command that installs it.
    """
    if importlib.util.find_spec("ray") is None:
        raise missing_extra("rollouts on a cluster need Ray", "cluster")
    return importlib.import_module("ray")


def _last_line(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[-1].strip() if lines else ''}"
