"""Stubs of small packages of ROS, and modules of Python whose clocks and threads are the simulated ones here."""

from __future__ import annotations

import argparse
import os
import random
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from .graph import NANOSECONDS
from .imports import Overlay, StandIn, package_folder
from .node_session import Session
from .workspace import packages as packages_of


class PackageNotFoundError(KeyError):
    pass


def other_modules(session: Session) -> dict[str, ModuleType]:
    """Return the modules of small packages for one node."""

    def folder_of(name: str) -> str:
        found = package_folder(session.file, name)
        if found is None:
            raise PackageNotFoundError(
                f"package {name!r} is not here; accepted: that of {session.file}, which has a package.xml, setup.py or "
                "a folder of that name, or of a neighbouring package"
            )
        return str(found)

    packages = StandIn(
        "ament_index_python.packages", get_package_share_directory=folder_of, get_package_prefix=folder_of,
        get_package_share_path=lambda name: Path(folder_of(name)), PackageNotFoundError=PackageNotFoundError,
    )  # fmt: skip
    return {
        "ament_index_python.packages": packages,
        "ament_index_python": StandIn("ament_index_python", **_public(packages)),
        "rospkg": StandIn(
            "rospkg",
            RosPack=lambda *_: SimpleNamespace(get_path=folder_of, list=lambda: list(packages_of(session.file))),
            ResourceNotFound=PackageNotFoundError,
        ),
        "message_filters": _message_filters(),
    }


def _message_filters() -> ModuleType:
    class Filter:
        def __init__(self) -> None:
            self._calls: list[tuple[Callable[..., Any], tuple[Any, ...]]] = []

        def registerCallback(self, callback: Callable[..., Any], *values: Any) -> None:  # noqa: N802
            self._calls.append((callback, values))

        def signal_message(self, *messages: Any) -> None:
            for callback, values in self._calls:
                callback(*messages, *values)

    class Subscriber(Filter):
        def __init__(self, *values: Any, qos_profile: Any = 10, **named: Any) -> None:
            super().__init__()
            node, kind, topic = values[:3]
            depth = values[3] if len(values) > 3 else qos_profile
            self.sub = node.create_subscription(kind, topic, self.signal_message, depth)

    class Synchronizer(Filter):
        """Calls with the newest message of each, once the stamps lie within `slop` [s] of each other."""

        def __init__(self, fs: Any, queue_size: int = 10, slop: float = 0.0, **_: Any) -> None:
            super().__init__()
            self._newest: list[Any] = [None] * len(fs)
            self._slop = slop
            for i, each in enumerate(fs):
                each.registerCallback(self._take, i)

        def _take(self, message: Any, i: int) -> None:
            self._newest[i] = message
            if any(each is None for each in self._newest):
                return
            stamps = [_seconds(each.header.stamp) for each in self._newest]
            if max(stamps) - min(stamps) <= self._slop + 1e-9:
                newest, self._newest = self._newest, [None] * len(self._newest)
                self.signal_message(*newest)

    class Cache(Filter):
        """Keeps the last messages of another filter."""

        def __init__(self, f: Any = None, cache_size: int = 1, allow_headerless: bool = False) -> None:
            super().__init__()
            self._kept: deque[Any] = deque(maxlen=cache_size)
            if f is not None:
                f.registerCallback(self._take)

        def _take(self, message: Any) -> None:
            self._kept.append(message)
            self.signal_message(message)

        def getInterval(self, from_stamp: Any, to_stamp: Any) -> list[Any]:  # noqa: N802
            first, last = _any_seconds(from_stamp), _any_seconds(to_stamp)
            return [each for each in self._kept if first <= _seconds(each.header.stamp) <= last]

        def getElemBeforeTime(self, stamp: Any) -> Any:  # noqa: N802
            at = _any_seconds(stamp)
            return next((each for each in reversed(self._kept) if _seconds(each.header.stamp) <= at), None)

        def getElemAfterTime(self, stamp: Any) -> Any:  # noqa: N802
            at = _any_seconds(stamp)
            return next((each for each in self._kept if _seconds(each.header.stamp) >= at), None)

        def getLast(self) -> Any:  # noqa: N802
            return self._kept[-1] if self._kept else None

    return StandIn(
        "message_filters", Subscriber=Subscriber, TimeSynchronizer=Synchronizer, Cache=Cache,
        ApproximateTimeSynchronizer=Synchronizer, SimpleFilter=Filter,
    )  # fmt: skip


def random_overlays(seed: int) -> dict[str, ModuleType]:
    """Return `random`, `numpy` and `numpy.random` as a node sees them that draws numbers without a seed of its own.

    Their generators begin at a seed, and are the node's own. What it seeds itself has the numbers that it has anywhere.
    """
    plain, legacy = random.Random(seed), np.random.RandomState(seed)
    children = np.random.SeedSequence(seed)

    def default_rng(given: Any = None) -> np.random.Generator:
        return np.random.default_rng(children.spawn(1)[0] if given is None else given)

    class Unseeded(random.Random):
        """random.Random, which begins at a seed where a node gives it none."""

        def __init__(self, x: Any = None) -> None:
            super().__init__(plain.getrandbits(64) if x is None else x)

    class UnseededState(np.random.RandomState):
        """numpy.random.RandomState, the same."""

        def __init__(self, seed: Any = None) -> None:
            super().__init__(int(legacy.randint(2**31)) if seed is None else seed)

    of_plain = {name: getattr(plain, name) for name in random.__all__ if callable(getattr(plain, name, None))}
    of_legacy = {name: getattr(legacy, name) for name in np.random.__all__ if callable(getattr(legacy, name, None))}
    made = {"default_rng": default_rng, "RandomState": UnseededState}
    drawing = Overlay(np.random, **{**vars(np.random), **of_legacy, **made})
    return {
        "random": Overlay(random, **{**of_plain, "Random": Unseeded, "SystemRandom": random.SystemRandom}),
        "numpy.random": drawing,
        "numpy": Overlay(np, **{**vars(np), "random": drawing}),  # as quick as it
    }


def overlays(session: Session, sleep: Callable[[float], Any]) -> dict[str, ModuleType]:
    """Return modules of Python as a node sees them: `time` is simulated, threads take turns, arguments are its own."""
    graph = session.graph

    class Thread(threading.Thread):
        """A thread that takes turns with the node's."""

        def start(self) -> None:
            self.process = graph.start(self.name, self.run)

        def join(self, timeout: float | None = None) -> None:
            wake = None if timeout is None else graph.now + round(timeout * NANOSECONDS)
            graph.pause(wake, lambda: self.process.done)

        def is_alive(self) -> bool:
            return hasattr(self, "process") and not self.process.done

    class Event(threading.Event):
        """An event that is waited for in simulated time."""

        def wait(self, timeout: float | None = None) -> bool:
            if not self.is_set():
                graph.pause(None if timeout is None else graph.now + round(timeout * NANOSECONDS), self.is_set)
            return self.is_set()

    class Lock:
        """A lock that is waited for in simulated time: of one thread that runs nothing is to be protected."""

        reentrant = False

        def __init__(self) -> None:
            self._owner: Any = None
            self._count = 0

        def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
            mine = self.reentrant and self._owner is graph.current
            if self._count and not mine:
                if not blocking:
                    return False
                graph.pause(None if timeout < 0 else graph.now + round(timeout * NANOSECONDS), lambda: not self._count)
                if self._count:
                    return False
            self._owner = graph.current
            self._count += 1
            return True

        def release(self) -> None:
            if not self._count:
                raise RuntimeError("release of a lock that is not taken")
            self._count -= 1

        def locked(self) -> bool:
            return bool(self._count)

        def __enter__(self) -> bool:
            return self.acquire()

        def __exit__(self, *_: Any) -> None:
            self.release()

    class RLock(Lock):
        reentrant = True

    class Timer(Thread):
        """Calls a function after some simulated seconds."""

        def __init__(self, interval: float, function: Callable[..., Any], args: Any = None, kwargs: Any = None) -> None:
            super().__init__()
            self.interval, self.function, self.args, self.kwargs = interval, function, args or [], kwargs or {}
            self.finished = Event()

        def cancel(self) -> None:
            self.finished.set()

        def run(self) -> None:
            if not self.finished.wait(self.interval):
                self.function(*self.args, **self.kwargs)

    class Parser(argparse.ArgumentParser):
        """Of the node's arguments: those of this process are not the node's."""

        def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
            return super().parse_known_args(list(session.arguments) if args is None else args, namespace)

    environ = {**os.environ, **session.environment}
    own_environment = {"os": Overlay(os, environ=environ, getenv=environ.get), "os.path": os.path}
    return {
        **(own_environment if session.environment else {}),
        "time": Overlay(
            time, time=graph.wall_time, monotonic=graph.wall_time, perf_counter=graph.wall_time, sleep=sleep,
            time_ns=graph.read, clock=graph.wall_time,
            monotonic_ns=graph.read,
            perf_counter_ns=graph.read,
        ),
        "sys": Overlay(sys, argv=session.argv, path=list(sys.path)),
        "threading": Overlay(threading, Thread=Thread, Event=Event, Lock=Lock, RLock=RLock, Timer=Timer),
        "signal": Overlay(signal, signal=lambda *_: None),
        "argparse": Overlay(argparse, ArgumentParser=Parser),
    }  # fmt: skip


def _seconds(stamp: Any) -> float:
    return float(stamp.sec + stamp.nanosec / NANOSECONDS)


def _any_seconds(time: Any) -> float:
    """Return the seconds of a stamp, or of a Time of rclpy."""
    return float(time.nanoseconds) / NANOSECONDS if hasattr(time, "nanoseconds") else _seconds(time)


def _public(module: ModuleType) -> dict[str, Any]:
    return {name: value for name, value in vars(module).items() if not name.startswith("_")}
