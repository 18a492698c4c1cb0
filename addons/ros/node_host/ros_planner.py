"""A node of ROS, or several, as a planner: what the engine builds of `ros:path/node.py:ClassName`.

Each tick the nodes receive the scan, the odometry and the pose, and do all that is due in simulated time. The last
message that they have published on the drive topic is the command. Before the first the car stands.
"""

from __future__ import annotations

import inspect
import math
import sys
import warnings
import weakref
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import numpy as np

from fg_mujoco.course.files import is_file
from fg_mujoco.errors import ControllerError, FinalWarning
from fg_mujoco.lidar.beams import MOST_BEAMS
from fg_mujoco.messages import STOP, CarParameters, DriveCommand, LaserScan, Odometry, Sketch
from fg_mujoco.racing.planners import READ, PlannerScheme
from fg_mujoco.simulation.planner_adapter import Surroundings
from fg_mujoco.simulation.planner_failure import one_line
from fg_mujoco.simulation.showing import listener

from ..bag_messages import nanoseconds
from .drawings import Drawings
from .drive_topics import DRIVE, OPPONENT_DRIVE, Driving
from .graph import BEGIN, NANOSECONDS, Graph, NodeError, Process
from .imports import Imports
from .message_classes import Definitions, message_class, require_rosbags
from .node_session import Session
from .other_modules import other_modules, overlays, random_overlays
from .program import NodeFile, Program, parameters_in, read_arguments, read_program, start_launch_file
from .rclpy_modules import rclpy_modules
from .ros_parameters import read_ros_arguments
from .sensing import Sensing, is_anothers
from .sensor_modules import sensor_modules
from .services import Call
from .transform_modules import transform_modules

WALL_LIMIT = 30.0
"""[s] of wall time that a node may take for what is due at one instant: it may load, or compile, in there."""
_OF_GYM = "1080"  # beams of f1tenth_gym_ros, which many nodes have in them
_SEED = 0  # of random numbers that a node draws without a seed of its own
PATIENCE = 5.0
"""[s] simulated in which a node must have published its first command."""


class RosPlanner:
    """Nodes as a planner; `find_node` makes a class of it for each program.

    Nothing faster than `max_speed` [m/s] is commanded. `settings` are parameters of the nodes, by name; `remap./scan`
    is another name for a topic, `host.params` a file of parameters, `host.args` the arguments of a node, `host.beams`
    how many beams a scan has, `launch.NAME` an argument of a launch file of ROS 2, `host.wall_limit` the wall time that
    a node may take [s]. Raises ControllerError: a parameter that no node has, or a node that cannot drive.
    """

    any_settings = True
    _program: ClassVar[Program]
    _graph: Graph
    _sensing: Sensing
    _driving: Driving
    _drawings: Drawings
    _ticked: bool
    _failed: list[str]  # of nodes that the others drive on without
    _ended: list[Process]  # of nodes, failed ones included, that have been told of

    def __init__(self, car: CarParameters, max_speed: float, settings: Mapping[str, Any] | None = None) -> None:
        self._car, self._max_speed, self._settings = car, max_speed, dict(settings or {})
        self._build()

    def reset(self) -> None:
        """End the nodes, and start them anew."""
        if self._ticked:
            self._close()
            self._build()

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Tell the nodes what the car senses, and return the last command that they have published."""
        if not self._ticked:
            self._ticked, self._began = True, scan.stamp
            self._sensing.opponent = any(each.topic == OPPONENT_DRIVE for each in self._driving.topics())
            self._take_others_names()
            self._warn_of_silence()
        time = BEGIN + nanoseconds(max(scan.stamp, odometry.stamp))
        self._graph.listener = listener()
        self._run(lambda: self._graph.tick(time, self._sensing.messages(scan, odometry)))
        over = all(process.done for process in self._graph.processes)
        for process in self._graph.processes[: len(self._sessions)]:
            if process.done and process not in self._ended:
                self._ended.append(process)
                then = "; the car stops" if over else ""
                warnings.warn(f"node {process.name!r} has ended, t = {scan.stamp:.3f} s{then}", stacklevel=2)
        return STOP if over else self._command(scan.stamp - self._began, odometry.speed)

    def look_round(self, surroundings: Surroundings) -> None:
        """Take what surrounds the car: nodes may listen to the map and to the other cars' odometry."""
        self._sensing.surroundings = surroundings

    @property
    def files(self) -> list[str]:
        """The files that the nodes have read: those of data, and those of parameters that `host.params` names."""
        params = self._settings.get("host.params")
        read = [path for path in self._graph.data if is_file(path)]
        return sorted({*read, *([] if params is None else [str(params)])})

    def drawings(self) -> list[Sketch]:
        """Return the markers, paths and poses that the nodes show, those published since this was asked first."""
        journal, self._graph.journal = self._graph.journal, []
        for time, topic, message in journal or ():
            self._drawings.take(topic, message, time)
        return self._drawings.now()

    def _build(self) -> None:
        """Start the nodes."""
        require_rosbags()
        self._ticked, self._began = False, 0.0
        given = dict(self._settings)
        limit = given.pop("host.wall_limit", WALL_LIMIT)
        if not isinstance(limit, (int, float)) or not 0.0 < limit < math.inf:
            raise ControllerError(f"host.wall_limit is {limit!r}; accepted: a positive number of seconds")
        beams = given.pop("host.beams", None)
        if beams is not None and not (isinstance(beams, int) and 2 <= beams <= MOST_BEAMS):
            raise ControllerError(f"host.beams is {beams!r}; accepted: a whole number from 2 to {MOST_BEAMS}")
        file = given.pop("host.params", None)
        arguments = read_arguments(given.pop("host.args", None), "host.args")
        remap = {name.removeprefix("remap."): str(given.pop(name)) for name in list(given) if name.startswith("remap.")}
        for_launch = {name[7:]: given.pop(name) for name in list(given) if name.startswith("launch.")}
        program, read = type(self)._program, set[str]()
        if program.files:
            launching = Graph(float(limit))
            nodes = start_launch_file(program, for_launch, program.path.name, launching)
            program, read = replace(program, nodes=nodes), launching.data
        elif for_launch:
            name = next(iter(for_launch))
            raise ControllerError(f"there is no launch argument {name!r}; accepted: with a launch file of ROS 2")
        self._program = program  # type: ignore[misc]
        self._graph = Graph(float(limit))
        self._graph.data |= read
        self._close = weakref.finalize(self, self._graph.close)
        self._drawings = Drawings(self._graph)
        message_class("std_msgs/msg/Header")  # definitions are read here, and not in a node's time
        self._sensing = Sensing(self._graph, self._car, beams)
        self._driving = Driving(self._graph, self._car, partial(_said, self._graph, self._program))
        goes_on, self._failed, self._ended = weakref.WeakMethod(self._goes_on_without), [], []
        self._graph.spares = lambda process, error: goes_on()(process, error)  # type: ignore[misc]
        self._sessions, definitions = [], Definitions()
        for node in self._program.nodes:
            said = read_ros_arguments(arguments or node.arguments, node.name, self._said())
            called, namespace = said.name or node.name, (said.namespace or node.namespace).strip("/")
            files = (*([] if file is None else [Path(file)]), *said.files)
            self._graph.data |= set(map(str, said.files))
            parameters = partial(_parameters_of, node.parameters, files, {**said.parameters, **given}, self._said())
            session = Session(
                self._graph, node.path, parameters(f"{namespace}/{called}" if called else ""),
                {**node.remap, **said.remap, **remap}, called, said.plain, namespace=namespace,
                environment=node.environment,
                undeclared=frozenset(node.parameters if node.takes_all else ()),
                given_to=parameters if files and not called else None,
            )  # fmt: skip
            self._sessions.append(session)
            self._graph.start(node.name or node.class_name or node.path.stem, _starter(session, node, definitions))
        try:
            self._run(self._graph.settle)
            self._check()
        except BaseException:
            self._close()
            raise

    def _run(self, act: Callable[[], None]) -> None:
        """Let nodes run; an error in one of several names its own file and line."""
        try:
            act()
        except Exception as error:
            of_shape = isinstance(error, (IndexError, ValueError)) and _OF_GYM in str(error)
            if of_shape and "host.beams" not in self._settings:
                warnings.warn(
                    f"{self._said()} may have been written for the {_OF_GYM} beams of f1tenth_gym_ros, and a scan has "
                    f"another number here: [host.beams={_OF_GYM}]",
                    stacklevel=2,
                )
            if len(self._program.nodes) == 1 or isinstance(error, NodeError):
                raise
            raise NodeError(f"{one_line(error)}{self._graph.place_of_error(error)}") from error

    def _goes_on_without(self, process: Process, error: Exception) -> bool:
        """Return whether the other nodes drive on without one that has failed, as in ROS; a warning says so."""
        graph, several = self._graph, self._graph.processes[: len(self._sessions)]
        needed = self._ticked and any(
            each.process is process and (each.commands or graph.listens(each.topic)) for each in graph.publications
        )
        if process not in several or all(each.done for each in several) or needed or not process.done:
            return False
        self._failed.append(f"node {process.name!r} has failed: {one_line(error)}{graph.place_of_error(error)}")
        self._ended.append(process)
        warnings.warn(f"{self._failed[-1]}; the other nodes drive on", stacklevel=2)
        graph.bury(process)
        return True

    def _check(self) -> None:
        """Refuse nodes that cannot drive, and parameters that none of them has."""
        processes = self._graph.processes
        nodes = list(zip(self._sessions, self._program.nodes, processes, strict=False))
        self._ended += [process for process in processes if process.done]
        known = set().union(*(session.asked for session, _, _ in nodes))
        unread = b"".join(node.text for _, node, process in nodes if process.done)
        known |= {name for name in self._settings if name.encode() in unread}
        for session, _, process in nodes:
            session.asked |= known & set(self._settings)
            wrong = "" if process.done and len(nodes) > 1 else session.unknown_parameters()
            if wrong:
                raise NodeError(f"{self._said()} {wrong}{self._line()}")
        if all(process.done for process in processes):
            raise NodeError(
                f"{self._said()} has ended at once; accepted: one that spins, or a class: ros:{self._program.path}:"
                f"ClassName{self._line()}"
            )
        drives = self._driving.topics()
        if all(process.done or process.spinning for process in processes) and not drives:
            raise NodeError(self._no_drive())

    def _no_drive(self) -> str:
        topics = sorted({each.topic for each in self._graph.publications})
        return (
            f"{self._said()} publishes on no drive topic; accepted: AckermannDriveStamped on {DRIVE}; it publishes on "
            f"{', '.join(topics) or 'none'}{self._line()}{''.join(f'; {each}' for each in self._failed)}"
        )

    def _command(self, driven: float, speed: float) -> DriveCommand:
        """Return the last command; `driven` is the simulated time since the first scan [s], `speed` the car's [m/s]."""
        asked = self._driving.asked(speed)
        if asked is None:
            if driven >= PATIENCE:
                raise NodeError(self._silent())
            return STOP
        limited = max(-self._max_speed, min(self._max_speed, float(np.float32(asked[0]))))
        self._sensing.command = limited, float(asked[1])
        return DriveCommand(steering_angle=float(np.float32(asked[1])), speed=limited)

    def _silent(self) -> str:
        """Return the message for nodes that have published no command within PATIENCE."""
        drives = self._driving.topics()
        waits = "".join(f"; it waits for {session.waits}" for session in self._sessions if session.waits)
        if not drives:
            return self._no_drive() + waits
        waits += "".join(f"; {each}" for each in self._failed)
        return (
            f"{self._said()} has published nothing on {drives[0].topic} within {PATIENCE:g} s{drives[0].place}{waits}"
        )

    def _take_others_names(self) -> None:
        """Give a topic that nobody publishes on what is published here in its type, where it is the only one of it."""
        published = {each.topic for each in self._graph.publications}
        listened = {each.topic: each.kind for each in self._graph.subscriptions}
        for topic, kind in listened.items():
            others = published | {each for each in listened if is_anothers(each)}
            alike = [each for each in listened if listened[each] is kind and each not in others]
            ours = self._sensing.taken_for(topic, kind)
            here = self._sensing.kind_of(topic)
            if ours is None or alike != [topic] or (here and message_class(here) is kind):
                continue
            lacks = f"is {here} here" if here else "has no publisher here"
            for each in self._graph.subscriptions:
                if each.topic == topic:
                    each.topic = ours
                    said = f"{topic} {lacks}, and is taken for {ours}; node {each.node!r} listens"
                    warnings.warn(f"{said}{each.place}", stacklevel=2)

    def _warn_of_silence(self) -> None:
        """Warn, in one line, of topics that nodes listen to and nobody publishes on, or not in that type."""
        published = {each.topic for each in self._graph.publications}
        found: dict[str, None] = {}
        for each in self._graph.subscriptions:
            if each.kind is Call or each.topic in published:
                continue
            kind = self._sensing.kind_of(each.topic)
            if kind is None:
                found[f"{each.topic} has no publisher here; node {each.node!r} listens{each.place}"] = None
            elif each.kind is not message_class(kind):
                said = f"{each.topic} is {kind} here; node {each.node!r} listens for {each.kind.__name__}"
                found[f"{said}{each.place}"] = None
        if found:
            warnings.warn("; ".join(found), FinalWarning, stacklevel=2)

    def _said(self) -> str:
        return _said(self._graph, self._program) if hasattr(self, "_graph") else self._program.path.name

    def _line(self) -> str:
        node = self._program.nodes[0]
        return f" ({node.path}, line {node.line})" if len(self._program.nodes) == 1 else f" ({self._program.path})"


def _parameters_of(
    own: Mapping[str, Any], files: Sequence[Path], given: Mapping[str, Any], said: str, node: str
) -> dict[str, Any]:
    """Return the parameters of a node of a full name: its own, those of files, and those that are given."""
    of_files = {name: value for file in files for name, value in parameters_in(file, node, said).items()}
    return {**own, **of_files, **given}


def _said(graph: Graph, program: Program) -> str:
    """Return the name of nodes for messages."""
    names = [process.name for process in graph.processes]
    return f"node {names[0]!r}" if len(names) == 1 else f"{program.path.name}"


def find_node(source: str) -> type[RosPlanner]:
    """Return the class of planners of a program; nothing of it is executed. Errors as of `read_program`."""
    program = read_program(source)
    place = str(program.path)
    module = ModuleType(f"fg_mujoco_ros_{program.path.stem}_{zlib.crc32(place.encode()):08x}")
    module.__file__ = place
    vars(module)[READ] = program.text
    sys.modules[module.__name__] = module  # where `planner_origin.source_code` finds what was read
    said = f"Nodes of ROS: {', '.join(node.path.name for node in program.nodes) or program.path.name}."
    return type(program.name, (RosPlanner,), {"_program": program, "__module__": module.__name__, "__doc__": said})


def source_text(source: str) -> bytes:
    """Return the code that `ros:...` names: the node's file; of a launch file that and the nodes' files."""
    return read_program(source).text


def vehicle_of(code: bytes) -> str | None:
    """Return the league's car for nodes that name AutoDRIVE's topic of the throttle, which is a speed of its wheels."""
    return "autodrive" if b"/autodrive/" in code and b"throttle_command" in code else None


NODES = PlannerScheme(find=find_node, code=source_text, vehicle=vehicle_of)
"""Planners whose texts begin with `ros:`."""


def _starter(session: Session, node: NodeFile, definitions: Definitions) -> Callable[[], None]:
    """Return the function that the thread of a node runs; nodes of a planner share the definitions of messages."""
    modules = {
        **rclpy_modules(session), **transform_modules(session), **sensor_modules(), **other_modules(session),
    }  # fmt: skip
    graph = session.graph

    def sleep(seconds: float) -> None:
        graph.pause(graph.now + max(1, round(float(seconds) * NANOSECONDS)))

    imports = Imports(
        node.path, graph, definitions, modules, overlays(session, sleep), random_overlays(_SEED)
    )  # fmt: skip

    def run() -> None:
        if node.entry:
            getattr(imports.run(node.path, node.text, node.path.stem), node.entry)()
            return
        if not node.class_name:
            module = imports.run(node.path, node.text, "__main__" if node.is_script else node.path.stem)
            if not node.is_script and node.has_main:
                needed = [p for p in inspect.signature(module.main).parameters.values() if p.default is p.empty]
                module.main(*(None for p in needed if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)))
            return
        module = imports.run(node.path, node.text, node.path.stem)
        kind = getattr(module, node.class_name)
        modules["rclpy"].init()
        made = kind()
        if not isinstance(made, modules["rclpy.node"].Node):
            raise TypeError(f"class {node.class_name} is no Node; accepted: a Node, or without class: ros:{node.path}")
        modules["rclpy"].spin(made)

    return run
