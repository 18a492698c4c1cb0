"""The cards of the bundled planners and baselines by the bundled suite, and the bounds of its lap times.

    python benchmarks/cards.py        # `make cards`: writes addons/arena/bench/cards.json and docs/cards.md

Some minutes on two cores. The planners are driven as they come, and refined without stages, too, because at `none` they
are as their sources have them.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fg_mujoco.addons.arena.bench.card import REACTIVE, RECORDED, bench, bound_key, recorded
from fg_mujoco.addons.arena.bench.card_page import scores_table
from fg_mujoco.addons.arena.study.suite import Suite, read_suite
from fg_mujoco.addons.drivers.racelines.raceline import make_raceline
from fg_mujoco.controllers import BASELINES, CONTROLLERS
from fg_mujoco.racing.setup import Setup

PAGE = Path(__file__).parents[1] / "docs" / "addons" / "arena" / "cards.md"
BEGIN, END = "<!-- cards: made by make cards -->", "<!-- end of cards -->"
METHODS = tuple(name for name in CONTROLLERS if name != "wall_follow")  # of which source and refined differ


def bounds(suite: Suite) -> dict[str, float]:
    """Return the lap times of the racelines of the suite's circuits [s], by `bound_key`."""
    found: dict[str, float] = {}
    for setup in (setup for group in suite.groups for _, setup in group.setups()):
        key, settings = bound_key(setup.described()), setup.described()
        if not settings["track"].startswith("scene:") and key not in found:
            own = {name: settings[name] for name in ("track", "mu", "max_speed") if name in settings}
            found[key] = round(make_raceline(Setup.of(**own)).lap_time, 3)
            print(key, found[key], flush=True)
    return found


def write(values: dict[str, Any]) -> None:
    """Write the recorded cards, a planner a line."""
    lines = [f"{json.dumps(name)}: {json.dumps(each)}" for name, each in values["cards"].items()]
    head = ",\n".join(f"{json.dumps(name)}: {json.dumps(each)}" for name, each in values.items() if name != "cards")
    RECORDED.write_text(f"{{{head},\n" + '"cards": {\n' + ",\n".join(lines) + "\n}}\n")


def main() -> None:
    """Make the cards."""
    suite, cards = read_suite(REACTIVE), dict[str, Any]()
    planners = [*CONTROLLERS, *(f"{name}[method=refined]" for name in METHODS), *BASELINES]
    known = {"suite_sha256": suite.sha256, "bounds": bounds(suite)}
    write(known | {"cards": {}})
    recorded.cache_clear()
    for planner in planners:
        card = bench(planner, suite)
        cards[planner] = {
            assist: {"score": round(card.score(assist), 1)}
            | {group: round(card.score(assist, group), 1) for group in card.groups(assist)}
            for assist in card.rows
        }
        print(planner, {assist: each["score"] for assist, each in cards[planner].items()}, flush=True)
    write(known | {"cards": cards})
    text = PAGE.read_text()
    before, after = text[: text.index(BEGIN)], text[text.index(END) :]
    PAGE.write_text(f"{before}{BEGIN}\n\n{scores_table(cards).markdown()}\n{after}")


if __name__ == "__main__":
    main()
