"""Race control: who touched whom and whose fault it was, who overtook whom, and what the rules make of it.

It watches a world of an engine, tick by tick, and is a layer above the physics: without rules it only keeps a record.

    control = RaceControl(engine, names=("a", "b"), rules=RULES["roboracer_2026"])
    while engine.running.any():
        engine.tick()
        control.after_tick()
    control.contacts, control.overtakes, control.warnings

A referee judges by eye. Here fixed rules take his place; each is given with its thresholds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.messages import FloatArray
from fg_mujoco.racing.entries import BOTH, NO_FAULT
from fg_mujoco.racing.rules import Contact, Overtake, RaceRecord, Restart, Rules, Warned
from fg_mujoco.simulation.cars import TOUCH_READINGS, touch_places
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.settings import Start
from fg_mujoco.simulation.telemetry import TELEMETRY
from fg_mujoco.simulation.termination import END_REASONS

from .fault import judge
from .recent_motion import RecentMotion

OVERTAKE_LEAD = 0.5
"""Of the passing car's length by which it has to lead: RoboRacer rules 3.2026."""

OVERTAKE_HELD = 1.0
"""[s] for which it has to lead by that; the rules name no time, so that a nose ahead in one bend would count."""

CONTACT_ENDS = 1.0
"""[s] without touching after which a contact is over: cars that push each other again and again have one contact."""

APART = 0.2
"""[s] without touching after which race control intervenes, where there are rules; cars that push each other bounce."""

LONGEST_PUSH = 1.0
"""[s] after which it intervenes where cars still touch: one that pushes another on and on. That is never free."""

PUSHED_ON = 0.5
"""[s] after a touch for which a car that was pushed is not at fault for what it drives into."""

_TIME, _PROGRESS, _COMMANDED = (TELEMETRY.index(name) for name in ("time_s", "progress_m", "command_speed_m_s"))
_AHEAD_OF_ALL = 1e9  # [m] beyond any progress: a car that has finished is ahead of those that have not
_FINISHED, _CRASH, _DISQUALIFIED = END_REASONS.index("finished"), END_REASONS.index("crash"), "disqualified"


@dataclass(kw_only=True)
class _Touching:
    """A contact that is not over."""

    time: float
    since: float  # when the cars began to touch without a pause of APART
    last: float
    impulse: float
    pushed: dict[int, tuple[float, float]]  # of each car, how fast [m/s] and how far [m] it would have been pushed
    closing: float
    at_fault: tuple[int, ...]
    reason: str
    place: tuple[float, float]


@dataclass(kw_only=True)
class _Order:
    """Who of two cars leads: 1 the first, -1 the second, 0 nobody yet."""

    leads: int = 0
    since: float = field(default=math.nan)  # [s] when another began to lead by enough
    new: int = 0
    at: float = 0.0  # [m] progress of the new leader then


class RaceControl(RaceRecord):
    """Watches the cars of a world of an engine.

    Args:
      engine: with its cars placed.
      names: of the cars.
      rules: what is done about contacts.
      world: its number in the engine.
    """

    def __init__(self, engine: Engine, *, names: Sequence[str], rules: Rules, world: int = 0) -> None:
        super().__init__(engine, names=names)
        self._rules = rules
        self._world, self._built = world, engine.world_of(world)
        count, built = len(names), self._built
        self._rows = slice(world * count, (world + 1) * count)  # of its cars among the engine's
        self._places = touch_places(built.model, count)
        self._pairs = [(a, b) for a in range(count) for b in range(a + 1, count)]
        self._found = np.array([self._places[pair] for pair in self._pairs], np.int64)  # where each one's contacts are
        self._open: dict[tuple[int, int], _Touching] = {}
        self._orders = {pair: _Order() for pair in self._pairs}
        self._timestep = float(built.model.opt.timestep)
        self._parameters = [car.parameters for car in engine.cars[self._rows]]
        self._lengths = [car.length for car in self._parameters]
        self._masses = [car.mass for car in self._parameters]
        self._grips = [car.mu * car.parameters.gravity for car in engine.cars[self._rows]]
        self._recent = RecentMotion(engine, world)
        self._tick = 0
        progress = self._timers["progress"].tolist()
        for (a, b), order in self._orders.items():
            order.leads = self._leader(a, b, progress)

    def after_tick(self) -> None:
        """Look at the tick that was driven and judged; put cars back, and end the race of one that is disqualified."""
        self._tick += 1
        self._recent.keep()
        time = self._engine.time(self._world)
        self._look_for_touches(time)
        if self.puts_back_at_walls:
            self._look_for_wall_contacts(time)
        self._look_for_overtakes(time)

    def finish(self) -> None:
        """Close what is still open, at the end of the race."""
        for pair in sorted(self._open):
            self._close(pair)
        self.contacts.sort(key=lambda contact: contact.time_s)

    def order(self) -> list[int]:
        """Return the cars in the order of the result: by when they finished, then by how far they came."""
        timers, finished = self._timers, self._engine.monitor.reasons[self._rows] == _FINISHED
        at = np.where(finished, timers["lap_start"], math.inf)  # of the lap that would come next
        return sorted(range(len(at)), key=lambda car: (float(at[car]), -float(timers["progress"][car]), car))

    @property
    def winner(self) -> str | None:
        """See RaceRecord."""
        first = self.order()[0]
        return self._names[first] if self._engine.monitor.reasons[self._rows][first] == _FINISHED else None

    @property
    def _timers(self) -> NDArray[np.void]:
        """The lap timers of its cars, live."""
        timers: NDArray[np.void] = self._engine.monitor.timers[self._rows]
        return timers

    @property
    def puts_back_at_walls(self) -> bool:
        """See RaceRecord."""
        return self._rules.checkpoints > 0

    def _look_for_wall_contacts(self, time: float) -> None:
        """Put the cars back whose race a wall has just ended, or disqualify them."""
        engine, rules = self._engine, self._rules
        for car in map(int, np.flatnonzero(engine.monitor.reasons[self._rows] == _CRASH)):
            row, count = self._rows.start + car, self.wall_contacts[car] + 1
            if count > rules.most_wall_contacts:
                engine.monitor.end(np.arange(len(engine.running)) == row, _DISQUALIFIED)
                continue
            self.wall_contacts[car] = count
            self._put_on_checkpoint(car)
            said = f"contact {count} with a wall: {rules.wall_penalty:g} s, and back to the last checkpoint"
            self.warnings.append(Warned(time_s=time, car=self._names[car], reason=said))

    def _put_on_checkpoint(self, car: int) -> None:
        """Put a car that has touched a wall on the line, standing, at the last checkpoint that it has passed."""
        engine, course, row = self._engine, self._built.track, self._rows.start + car
        timer = self._timers[car]
        apart = course.length / self._rules.checkpoints
        passed = math.floor(max(float(timer["furthest"]), 0.0) / apart) * apart
        s = float(timer["place"]) - (course.origin or 0.0) + passed - float(timer["progress"])
        engine.crashed[row], engine.monitor.reasons[row], engine.running[row] = False, 0, True
        self._put(car, Start(s=s if course.closed else max(s, 0.0)))
        engine.touched_at[row, car] = engine.time(self._world)

    def _look_for_touches(self, time: float) -> None:
        if not self._open and self._engine.touched_at[self._rows].max() < time:
            return
        records, begun = self._engine.records(self._world), float(self._engine.telemetry[self._rows.start, 0])
        touched: list[bool] = np.any(records[:, self._found] > 0.0, axis=0).tolist()
        readings = {
            pair: records[:, self._places[pair] : self._places[pair] + TOUCH_READINGS]
            for pair, touches in zip(self._pairs, touched, strict=True)
            if touches or pair in self._open
        }
        self._open_contacts({pair: found for pair, found in readings.items() if pair not in self._open}, begun)
        for pair, found in readings.items():
            contact, touching = self._open[pair], found[:, 0] > 0.0
            if touching.any():
                if time - contact.last >= APART:
                    contact.since = time
                contact.last = time
            self._push(contact, np.where(touching, np.linalg.norm(found[:, 1:4], axis=1), 0.0))
            settled = time - contact.last >= APART or _is_long_push(contact)
            if (settled and self._is_crash(contact)) or time - contact.last >= CONTACT_ENDS:
                asked = not self._is_free(contact)
                self._close(pair)
                if asked:
                    self._intervene(contact, pair, time)

    def _open_contacts(self, readings: Mapping[tuple[int, int], FloatArray], begun: float) -> None:
        """Judge the touches that begin in a tick, each by the sensor's readings (substeps, TOUCH_READINGS)."""
        steps = {pair: int((found[:, 0] > 0.0).argmax()) for pair, found in readings.items()}
        verdicts = {pair: judge(self._recent.incident(pair, step)) for pair, step in steps.items()}
        pushed = self._pushed_on(begun) | {
            (car, pair) for pair, verdict in verdicts.items() for car in _innocent(pair, verdict.at_fault)
        }
        for pair, step in steps.items():
            by_others = tuple(any(own == car and by != pair for own, by in pushed) for car in pair)
            verdict = verdicts[pair]
            if any(by_others):
                verdict = judge(self._recent.incident(pair, step, (by_others[0], by_others[1])))
            forces = np.linalg.norm(readings[pair][:, 1:4], axis=1)  # where there is none, there is no place of it
            where = readings[pair][int((forces > 0.0).argmax()), 4:6] if forces.any() else self._recent.between(pair)
            place = (float(where[0]), float(where[1]))
            self._open[pair] = _Touching(
                time=begun, since=begun, last=begun, impulse=0.0, closing=self._recent.closing_speed(pair, step, place),
                at_fault=tuple(pair[car] for car in verdict.at_fault), reason=verdict.reason, place=place,
                pushed=dict.fromkeys(pair, (0.0, 0.0)),
            )  # fmt: skip

    def _pushed_on(self, time: float) -> set[tuple[int, tuple[int, int]]]:
        """Return the cars that others pushed shortly before a time without fault of theirs, each with the pair."""
        return {
            (car, pair)
            for pair, contact in self._open.items()
            if contact.at_fault and time - contact.last <= PUSHED_ON
            for car in pair
            if car not in contact.at_fault
        }

    def _push(self, touching: _Touching, forces: FloatArray) -> None:
        """Add what the forces of a tick's steps do [N]: to a block of each car's mass and friction, which stood."""
        touching.impulse += float(forces.sum()) * self._timestep
        for car, (speed, way) in touching.pushed.items():
            for force in forces.tolist():
                speed = max(0.0, speed + (force / self._masses[car] - self._grips[car]) * self._timestep)
                way += speed * self._timestep
            touching.pushed[car] = (speed, way)

    def _is_crash(self, contact: _Touching) -> bool:
        """Return whether the rules ask for something after a contact, of a car that still races."""
        at_fault = any(self._engine.running[self._rows][car] for car in contact.at_fault)
        return at_fault and not self._is_free(contact)

    def _is_free(self, contact: _Touching) -> bool:
        """Return whether the rules ask for nothing after a contact: it displaces little, and was no long push.

        Displacement is that of a car that stands. One that rolls is pushed on by far less force.
        """
        if self._displacement(contact) >= self._rules.free_displacement:
            return False
        return math.isinf(self._rules.free_displacement) or not _is_long_push(contact)

    def _displacement(self, contact: _Touching) -> float:
        """Return how far the more easily pushed of two cars would have been pushed [m], see Contact."""
        return max(way + speed * speed / (2.0 * self._grips[car]) for car, (speed, way) in contact.pushed.items())

    def _close(self, pair: tuple[int, int]) -> None:
        """Keep a contact that is over."""
        touching = self._open.pop(pair)
        names = [self._names[car] for car in touching.at_fault]
        self.contacts.append(Contact(
            time_s=touching.time, cars=(self._names[pair[0]], self._names[pair[1]]), impulse_Ns=touching.impulse,
            closing_speed_m_s=touching.closing, displacement_m=self._displacement(touching),
            at_fault=BOTH if len(names) == 2 else (names or [NO_FAULT])[0], reason=touching.reason,
            x_m=touching.place[0], y_m=touching.place[1],
        ))  # fmt: skip

    def _intervene(self, contact: _Touching, pair: tuple[int, int], time: float) -> None:
        """Do what the rules ask for after a contact: warn who is at fault, and put one of them behind the other."""
        rules, engine, displaced = self._rules, self._engine, self._displacement(contact)
        guilty = [car for car in contact.at_fault if engine.running[self._rows][car]]
        for car in guilty:
            other = pair[1] if car == pair[0] else pair[0]
            said = f"displaced by {100.0 * displaced:.0f} cm"
            if displaced < rules.free_displacement:
                said = f"for {contact.last - contact.since:.1f} s"
            said = f"contact with {self._names[other]}, {said}"
            self.warnings.append(Warned(time_s=time, car=self._names[car], reason=said))
        for car in list(guilty):
            if sum(warned.car == self._names[car] for warned in self.warnings) >= rules.most_warnings:
                which = np.zeros(len(engine.running), np.bool_)
                which[self._rows.start + car] = True
                engine.monitor.end(which, _DISQUALIFIED)
                guilty.remove(car)
        if not guilty:
            return
        fault = min(guilty, key=lambda car: (float(self._timers["progress"][car]), car))  # of both the one behind
        other = pair[1] if fault == pair[0] else pair[0]
        row = self._rows.start + other
        drove_on = bool(engine.running[row]) and float(engine.telemetry[row, _COMMANDED]) > 0.5  # [m/s], not pushed
        behind = rules.restart_behind_driving if drove_on else rules.restart_behind
        self._put_behind(fault, other, behind)

    def _put_behind(self, car: int, other: int, behind: float) -> None:
        """Put a car on the line so far behind another [m], or behind that where somebody stands there."""
        course, timers = self._built.track, self._timers
        at = float(timers["place"][other])
        taken = [float(timers["place"][i]) for i in range(len(self._names)) if i != car]
        back = behind + 0.5 * (self._lengths[car] + self._lengths[other])
        while any(_apart(at - back, place, course.modulus) < 1.2 * self._lengths[car] for place in taken):
            back += 0.5 * self._lengths[car]
        s = at - back - (course.origin or 0.0)
        self._put(car, Start(s=s if course.closed else max(s, 0.0)))

    def _put(self, car: int, start: Start) -> None:
        """Put a car at a start, and keep that it was."""
        engine = self._engine
        engine.put(self._rows.start + car, start)
        self._recent.forget(car)
        self.restarts.append(
            Restart(time_s=engine.time(self._world), tick=self._tick, car=car, s_m=start.s, offset_m=start.offset)
        )

    def _leader(self, a: int, b: int, progress: Sequence[float]) -> int:
        """Return 1 where the first leads by enough of its length, -1 where the second does, else 0."""
        lead = progress[a] - progress[b]
        if lead >= OVERTAKE_LEAD * self._lengths[a]:
            return 1
        return -1 if -lead >= OVERTAKE_LEAD * self._lengths[b] else 0

    def _look_for_overtakes(self, time: float) -> None:
        reasons, progress = self._engine.monitor.reasons[self._rows], self._timers["progress"].tolist()
        racing = self._engine.running[self._rows] | (reasons == _FINISHED)
        for (a, b), order in self._orders.items():
            leads = self._leader(a, b, progress)
            if leads == 0 or leads == order.leads:
                order.new = 0
                continue
            if leads != order.new:
                order.new, order.since, order.at = leads, time, progress[a if leads > 0 else b]
            if time - order.since >= OVERTAKE_HELD - 1e-9:
                by, of = (a, b) if leads > 0 else (b, a)
                if order.leads != 0 and racing[a] and racing[b] and reasons[of] != _FINISHED:
                    self.overtakes.append(
                        Overtake(time_s=order.since, by=self._names[by], of=self._names[of], s_m=order.at)
                    )
                order.leads, order.new = leads, 0


def _is_long_push(contact: _Touching) -> bool:
    """Return whether two cars have touched for LONGEST_PUSH, without a pause of APART."""
    return contact.last - contact.since >= LONGEST_PUSH - 1e-9


def _innocent(pair: tuple[int, int], at_fault: Sequence[int]) -> list[int]:
    """Return the cars of a pair that are not at fault, where one is: `at_fault` counts within the pair."""
    return [car for place, car in enumerate(pair) if at_fault and place not in at_fault]


def _apart(one: float, other: float, modulus: float) -> float:
    """Return the distance between two places on a line [m]."""
    return abs((one - other + 0.5 * modulus) % modulus - 0.5 * modulus)


@dataclass(frozen=True, kw_only=True, eq=False)
class Standings:
    """Arrays have a row a car and a column a tick, and are of its start."""

    time: FloatArray  # (ticks,) [s]
    progress: FloatArray  # (cars, ticks) [m]
    positions: NDArray[np.intp]  # (cars, ticks) from 1: by progress; who has finished keeps the place of the result
    gaps_s: FloatArray  # (cars, ticks) [s] since the leader of that tick was where the car is; NaN where he never was,
    # and for a car whose race is over


def standings(telemetries: Sequence[FloatArray], rows: Sequence[Mapping[str, Any]]) -> Standings:
    """Return the standings of a race.

    Args:
      telemetries: of each car, (ticks, len(TELEMETRY)).
      rows: of each car, as in `cars` of the summary.
    """
    time = telemetries[0][:, _TIME]
    progress = np.array([telemetry[:, _PROGRESS] for telemetry in telemetries])
    over = np.array([time >= float(row.get("end_time_s", np.inf)) for row in rows])
    finished = over & np.array([[bool(row["finished"])] for row in rows])
    keys = np.where(finished, _AHEAD_OF_ALL - np.array([[float(row["position"])] for row in rows]), progress)
    order = np.argsort(-keys, axis=0, kind="stable")
    positions = np.empty(order.shape, np.intp)
    np.put_along_axis(positions, order, np.arange(1, len(rows) + 1)[:, np.newaxis], axis=0)
    gaps = np.full(progress.shape, np.nan)
    for leader in np.unique(order[0]) if len(time) else ():
        reached = np.maximum.accumulate(progress[leader])
        new = np.concatenate(([True], np.diff(reached) > 0.0))
        led = order[0] == leader
        gaps[:, led] = time[led] - np.interp(progress[:, led], reached[new], time[new], left=np.nan, right=np.nan)
        gaps[leader, led] = 0.0
    gaps[over] = np.nan
    return Standings(time=time, progress=progress, positions=positions, gaps_s=gaps)
