"""Which settings of a planner are best on a course, and whether they are safe.

    found = fg.tune("my.py:Mine", {"bubble": (0.2, 0.8), "speed": (2.0, 6.0)}, track="hall.yaml", mu=(0.5, 1.0))
    print(found.markdown())

Settings are draws of a scrambled Halton sequence, behind the planner's own ones. Each draw is driven under the same
conditions, each a friction, a start and a seed of all noise, so that draws differ by their settings alone. All runs are
one rollout, in which world i * conditions + j has draw i and condition j.

Source: A. B. Owen, A randomized Halton algorithm in R, arXiv:1706.02808, 2017 (scipy.stats.qmc.Halton).
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fg_mujoco.course.writing import write_file
from fg_mujoco.errors import SettingsError, missing_extra
from fg_mujoco.messages import FloatArray, require_whole
from fg_mujoco.pictures.pages.figure_kit import COLOURS, finish, render, require_matplotlib
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing import planners
from fg_mujoco.racing.entries import Entry, check_starts
from fg_mujoco.racing.planners import Value
from fg_mujoco.racing.randomization import OF_PLANNERS, PLANNER, Choice, Range, Uniform, as_range, world_seeds
from fg_mujoco.racing.resolved import ground_of
from fg_mujoco.racing.setup import Setup, StudyKeywords
from fg_mujoco.rollouts.rollout_result import RolloutResult
from fg_mujoco.rollouts.rollouts import Executor, RolloutProgress, rollout_setup
from fg_mujoco.rollouts.shares import wilson

from .study.suite import ASSIST, draws

if TYPE_CHECKING:
    from typing_extensions import Unpack

RUNS, CONDITIONS = 200, 8

_TRIES = 64  # points of the sequence for one that is wanted: choices repeat, and a car cannot start in a box
_MOST_WHOLE = 1000
_DIGITS = 3  # of a range: draws have steps of a thousandth of it or less, so that they can be pasted
_LEGEND = (
    "A run is safe that finishes its laps without a touch and without a slide; the share has Wilson's interval at "
    "95 %. The order is by safe runs, then by untouched finishes, then by the mean lap of the runs that finish. "
    '"Behind" is the mean difference to the first draw under the same conditions, with its interval at 95 %.'
)
_FIGURES = {"sliding": (100.0, 1), "mean_lap_s": (1.0, 2), "behind_s": (1.0, 2), "noise_s": (1.0, 2)}  # scale, digits
_HOLLOW = {"marker": "o", "fillstyle": "none", "color": "0.6", "label": "untouched; right: not safe in all runs"}
_FILLED = {"marker": "o", "color": COLOURS[0], "label": "safe; right: in all runs"}
_BEST = {"marker": "*", "color": COLOURS[1], "markersize": 10.0, "label": "best"}

Draw = dict[str, Value]  # by the columns of a rollout: `planner.SETTING`, `mu`, `start_s`


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """The result of tuning a planner."""

    head: str  # what was driven
    rows: tuple[dict[str, Any], ...]  # a draw each, the best first: its settings by columns of the rollout, and figures
    names: tuple[str, ...]  # of the settings, as columns
    best: str | None  # the options of the best draw, for the command line; None: no draw is safe in all runs
    rollout: RolloutResult

    @property
    def verdict(self) -> str:
        """The best draw, and how many others may be as good; or that none is safe."""
        first, *others = self.rows
        safe = f"safe in {first['safe']} of {first['runs']} runs"
        if self.best is None:
            free = first["assist"] == "none" and first["untouched"] > first["safe"]
            slides = "; --assist grip limits commands to the grip" if free else ""
            return f"no draw is safe in all of its runs; the first is {safe}, untouched in {first['untouched']}{slides}"
        same = [row for row in others if row["safe"] == first["safe"]]
        close = [row for row in same if row["noise_s"] is None or row["behind_s"] <= row["noise_s"]]
        more = f"; {len(close)} more are as safe, and no slower at 95 %" if close else ""
        return f"best, {safe}{more}:\n{self.best}"

    def table(self, most: int | None = None) -> Table:
        """Return the table for people, of the first draws or of all."""
        rows = [
            [f"{row['rank']}{' (own)' if row['own'] else ''}", *(row[name] for name in self.names), row["assist"],
             f"{row['safe']}/{row['runs']}", f"{100.0 * row['safe_low']:.0f} to {100.0 * row['safe_high']:.0f} %",
             f"{row['untouched']}/{row['runs']}",
             *(None if row[name] is None else f"{scale * row[name]:.{n}f}" for name, (scale, n) in _FIGURES.items())]
            for row in self.rows[:most]
        ]  # fmt: skip
        names = ("rank", *(name.removeprefix(PLANNER) for name in self.names), "assist", "safe", "95 % interval")
        header = (*names, "finished untouched", "sliding [%]", "mean lap [s]", "behind [s]", "+- [s]")
        return Table(header=header, rows=rows, left=("assist",), legend=_LEGEND)

    def markdown(self, most: int | None = None) -> str:
        """Return what was driven, the table of the first draws or of all, and the verdict."""
        return f"{self.head}\n\n{self.table(most).markdown()}\n{self.verdict}\n"

    def picture(self, path: str | Path) -> None:
        """Write a panel for each setting, of the safe runs and of the mean lap, to an .svg, .pdf or .png file."""
        require_matplotlib()
        runs, whole = self.rows[0]["runs"], np.array([row["safe"] == row["runs"] for row in self.rows])
        laps = np.array([row["mean_lap_s"] for row in self.rows], np.float64)

        def draw(figure: Any) -> None:
            panels = figure.subplots(len(self.names), 2, squeeze=False, sharex="row")
            for (left, right), name in zip(panels, self.names, strict=True):
                x = np.array([row[name] for row in self.rows])
                if x.dtype.kind in "bU":
                    words, x = np.unique(x, return_inverse=True)
                    left.set_xticks(range(len(words)), map(str, words))
                for kind, held, look in (("untouched", ~whole, _HOLLOW), ("safe", whole, _FILLED)):
                    left.plot(x, [100.0 * row[kind] / runs for row in self.rows], linestyle="none", **look)
                    right.plot(x[held], laps[held], linestyle="none", **look)
                right.plot(x[whole][:1], laps[whole][:1], linestyle="none", **_BEST)
                finish(left, name.removeprefix(PLANNER), "runs [%]", legend=False)
                finish(right, name.removeprefix(PLANNER), "mean lap [s]", legend=False)
                left.set_ylim(-5.0, 105.0)
            figure.legend(*right.get_legend_handles_labels(), loc="outside upper center", ncols=3)

        write_file(Path(path), render(draw, 0.5 + 2.0 * len(self.names), Path(path).suffix.removeprefix(".")))


def tune(  # type: ignore[misc]  # mu is drawn here
    controller: str,
    settings: Mapping[str, Any],
    *,
    mu: Any = None,
    runs: int = RUNS,
    conditions: int = CONDITIONS,
    assist: str | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
    executor: str = "threads",
    watch: Callable[[RolloutProgress], None] | None = None,
    setup: Setup | None = None,
    **keywords: Unpack[StudyKeywords],
) -> Tuning:
    """Drive a planner with many draws of its settings, each under the same conditions, and rank them.

    Args:
      controller: as `race` takes it by name; settings in its brackets are the same in all draws.
      settings: by name `(low, high)`, a list of values, or either as text: "0.2:0.8", "a|b". A setting whose default is
        a whole number has draws that are. `max_speed` and `planner_mu` may be among them.
      mu: friction of the tires: one, or `(low, high)` of the conditions; None: that of `setup`.
      runs: of all draws together, `runs // conditions` of them.
      conditions: of each draw. On a closed course each has another start; where nothing differs there is one.
      assist: stages between planner and car; None: that of `setup`, or none, and so no "full".
      out: a new or empty folder for the rollout and the table, or one of the same call, which then goes on.
      workers: as of `rollout`, as are `executor` and `watch`.
      setup: of the race; None: the defaults. Its seed is that of draws, conditions and noise.
      keywords: of a Setup, see there, that change `setup`; `laps` None is one.

    Raises:
      FgMujocoError: what cannot be driven, or SciPy is not installed; nothing has run then.
    """
    if importlib.util.find_spec("scipy") is None:
        raise missing_extra("draws of settings need SciPy", "tune")
    require_whole("conditions", conditions, 1)
    require_whole("runs", runs, 2 * conditions)
    friction = {"mu": as_range(mu)} if isinstance(mu, (str, tuple)) else {}
    base = Setup.of(setup, caller="tune", **keywords, **({} if friction or mu is None else {"mu": mu}))
    source, same = planners.split_controller(planners.only_planner(controller), base.first.planner_settings)
    assist = assist or (ASSIST if base.first.assist == "full" else base.first.assist)
    first = replace(base.first, controller=source, planner_settings=same, assist=assist)
    base = replace(base, laps=base.laps or 1, entries=(first, *base.entries[1:]))
    ranges, own = _ranges(settings, base)
    under, randomize = _conditions(base, friction, conditions)
    drawn, seed = _draws(ranges, own, runs // conditions, base.first.seed), base.first.seed
    result = rollout_setup(
        base, randomize=randomize | ranges, seeds=np.tile(world_seeds(seed, len(under)), len(drawn)), out=out,
        workers=workers, watch=watch, executor=Executor(kind=executor, chunk=4 * len(under)),
        values=[draw | each for draw in drawn for each in under],
    )  # fmt: skip
    found = _tuning(base, result, drawn, own, len(under))
    if out is not None:
        write_file(Path(out) / "table.csv", Table.of(found.rows).csv().encode())
        write_file(Path(out) / "table.md", found.markdown().encode())
    return found


def _ranges(given: Mapping[str, Any], base: Setup) -> tuple[dict[str, Range], Draw | None]:
    """Return the ranges of settings, and the planner's own values; None: they are not known, or of another kind."""
    source, own_settings = str(base.first.controller), base.first.planner_settings
    factory = planners.find_controller(source)
    defaults = planners.settings_of(factory) | dict(own_settings)
    if not given:
        known = ", ".join((*defaults, *OF_PLANNERS))
        raise SettingsError(f"no setting of {source!r} is given; accepted: LOW:HIGH or A|B, for some of {known}")
    context = base.drive_settings.context(base.first.car.parameters, ground_of(base).course.map_line)
    made = getattr(planners.build_controller(factory, source, context, own_settings), "settings", None)
    defaults = {name: getattr(made, name, None) if v in (None, "") else v for name, v in defaults.items()}
    defaults |= {"max_speed": base.first.max_speed, "planner_mu": base.first.assumed_mu}
    ranges, own = dict[str, Range](), Draw()
    for name, value in given.items():
        column, default = name if name in OF_PLANNERS else f"{PLANNER}{name}", defaults.get(name)
        try:
            ranges[column] = _range(as_range(value), default)
        except SettingsError as error:
            raise SettingsError(f"set {name}: {error}") from error
        kind = type(ranges[column].extremes[0])
        if type(default) is kind or (kind is float and type(default) is int):
            own[column] = kind(default)
    return ranges, own if len(own) == len(ranges) else None


def _range(values: Range, default: Any) -> Range:
    """Return a range of values of one kind: of a setting that is a whole number, of whole numbers."""
    whole = isinstance(default, int) and not isinstance(default, bool)
    if isinstance(values, Choice):
        kinds = set(map(type, values.values))
        if kinds <= {int, float} and not (whole and kinds == {int}):
            return Choice(tuple(map(float, values.values)))
        if len(kinds) > 1:
            raise SettingsError(f"{values} has values of several kinds; accepted: numbers, true and false, or words")
    elif whole:
        each = tuple(range(round(values.low), round(values.high) + 1))
        if (each[0], each[-1]) != (values.low, values.high) or len(each) > _MOST_WHOLE:
            raise SettingsError(f"{values}; accepted: whole numbers, as the setting's own, {_MOST_WHOLE} at most")
        return Choice(each)
    return values


def _points(ranges: Mapping[str, Range], wanted: int, seed: int) -> list[Draw]:
    """Return points of a scrambled Halton sequence, several for each that is wanted, as values."""
    from scipy.stats import qmc  # heavy

    shares = qmc.Halton(len(ranges), seed=seed).random(_TRIES * wanted)
    return [{name: _at(ranges[name], s) for name, s in zip(ranges, row, strict=True)} for row in shares.tolist()]


def _at(values: Range, share: float) -> Value:
    """Return the value at a share of a range, with so many digits that it can be read."""
    if isinstance(values, Choice) or values.high == values.low:
        return values.at(share)
    digits = _DIGITS - math.floor(math.log10(values.high - values.low))
    return min(max(round(values.at(share), digits), values.low), values.high)


def _draws(ranges: Mapping[str, Range], own: Draw | None, most: int, seed: int) -> list[Draw]:
    """Return draws of settings that differ, `most` unless there are fewer; `own` is the first, if it is known."""
    draws = [*([] if own is None else [own]), *_points(ranges, most, seed)]
    return list({tuple(draw.values()): draw for draw in reversed(draws)}.values())[: -most - 1 : -1]


def _conditions(base: Setup, friction: dict[str, Range], count: int) -> tuple[list[Draw], dict[str, Range]]:
    """Return the conditions, one where nothing differs, and the ranges of what they have."""
    ground, first, usual = ground_of(base), base.first, base.drive_settings.start
    ranges = dict(friction)
    if ground.course.closed and usual.s == 0.0:
        ranges["start_s"] = Uniform(0.0, ground.course.length)
    if not ranges:
        return [{}] * (count if any(map(draws, base.entries)) else 1), {}
    found: list[Draw] = []
    for values in _points(ranges, count, first.seed):
        start = replace(usual, s=float(values.get("start_s", usual.s)))
        try:
            check_starts(ground.course, [start], [first.car.parameters], [""], ground.boxes)
        except SettingsError:
            continue
        found.append(values)
        if len(found) == count:
            return found, ranges
    raise SettingsError(
        f"conditions is {count}, and {len(found)} starts are free; accepted: fewer conditions, or boxes"
    )


def _tuning(base: Setup, result: RolloutResult, drawn: Sequence[Draw], own: Draw | None, runs: int) -> Tuning:
    """Return the ranking of the draws, each of so many runs."""
    first, shape = base.first, (len(drawn), runs)
    touched = result["collisions"] + (result["contacts"] if "contacts" in result.names else 0) > 0
    untouched = ((result["end_reason"] == "finished") & ~touched).reshape(shape)
    sliding = np.nan_to_num(result["slide_time_fraction"]).reshape(shape)  # of tires that do not slide it is NaN
    safe, clean = (untouched & (sliding == 0.0)).sum(axis=1).tolist(), untouched.sum(axis=1).tolist()
    laps = result.lap_times_s.mean(axis=1).reshape(shape)  # NaN where one is missing
    means = [None if np.isnan(row).all() else float(np.nanmean(row)) for row in laps]
    order = sorted(range(len(drawn)), key=lambda at: (-safe[at], -clean[at], means[at] or math.inf, at))
    assist, best = first.planner_settings.get("assist", first.assist), drawn[order[0]]
    rows = []
    for rank, at in enumerate(order, start=1):
        (low, high), (behind, noise) = wilson(safe[at], runs), _behind(laps[at] - laps[order[0]])
        figures = {
            "assist": drawn[at].get(f"{PLANNER}assist", assist), "own": drawn[at] == own, "runs": runs,
            "safe": safe[at], "safe_low": low, "safe_high": high, "untouched": clean[at],
            "sliding": float(sliding[at].mean()), "mean_lap_s": means[at], "behind_s": behind, "noise_s": noise,
        }  # fmt: skip
        rows.append({"rank": rank} | drawn[at] | figures)
    source, same = str(first.controller), dict(first.planner_settings)
    of_planner = {name.removeprefix(PLANNER): v for name, v in best.items() if name.startswith(PLANNER)}
    options = [f'--controller "{planners.with_settings(source, same | of_planner)}"', f"--assist {first.assist}"]
    given = {name: value for name in OF_PLANNERS if (value := getattr(first, name)) != getattr(Entry(), name)}
    told = given | {name: best[name] for name in OF_PLANNERS if name in best}
    options += [f"--{name.replace('_', '-')} {value}" for name, value in told.items()]
    head = (
        f"{planners.with_settings(Path(source).name, same)} on {result.tracks[0].name}, assist "
        f"{', '.join(dict.fromkeys(str(row['assist']) for row in rows))}: {len(drawn)} draws of "
        f"{', '.join(name.removeprefix(PLANNER) for name in best)}, {runs} runs each, seed {first.seed}"
    )
    line = " ".join(options) if safe[order[0]] == runs else None
    return Tuning(head=head, rows=tuple(rows), names=tuple(best), best=line, rollout=result)


def _behind(differences: FloatArray) -> tuple[float | None, float | None]:
    """Return the mean of those lap times' differences that are known [s], and half of its interval, by Student's t."""
    from scipy.stats import t

    known = differences[~np.isnan(differences)]
    scale = known.std(ddof=1) / math.sqrt(len(known)) if len(known) > 1 else None
    half = None if scale is None else float(t.ppf(0.975, len(known) - 1) * scale)
    return (float(known.mean()) if len(known) else None), half
