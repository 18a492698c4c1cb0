"""Hostile input for every target: no traceback, no hang, no memory without bound; nothing is written if it is refused.

The same tries in every run; `make fuzz` draws others, and `python -m fuzzing` in this folder has the long form.
"""

import os
import time

import numpy as np
import pytest

from cases import each
from fuzzing.harness import Limits, knock
from fuzzing.target import Target
from fuzzing.targets import TARGETS

SEED = int(os.environ.get("FUZZ_SEED", "0"))
TRIES = 100 if SEED else 12  # those of seed 0 are the same in every run


@pytest.mark.fuzz
@each("target", TARGETS)
def test_hostile_input_is_refused_in_a_line_or_used(target):
    tally = knock(target, TRIES, seed=SEED)
    assert tally.tries == TRIES
    assert not tally.findings, "\n".join(map(str, tally.findings))


# -- the harness finds what it is there for: each of these targets has one fault in its third try


def _raises(samples, here, rng):
    raise_it = {}
    return lambda: raise_it["nothing"]


def _dies(samples, here, rng):
    return lambda: os.abort()


def _hangs(samples, here, rng):
    return lambda: time.sleep(3600)


def _takes_memory(samples, here, rng):
    return lambda: (np.ones(60_000_000), time.sleep(3600))


def _refuses_and_writes(samples, here, rng):
    return lambda: ((here / "left.csv").write_text("x") and print("fg-mujoco: no")) or 2


def _is_right(samples, here, rng):
    return lambda: 0


LIMITS = Limits(time=3.0, memory=400_000)

FAULTS = {
    "raises": (_raises, "KeyError: 'nothing'"),
    "dies": (_dies, "the process ended with -6"),
    "hangs": (_hangs, "more than 3 s"),
    "takes memory": (_takes_memory, "kB of memory"),
    "refuses and writes": (_refuses_and_writes, "refused, but wrote left.csv"),
}


def _third(attempt):
    """The harness numbers the folders of its tries."""
    return Target(
        attempt=lambda samples, here, rng: (attempt if here.name.endswith("-2") else _is_right)(samples, here, rng)
    )


faulty = {name: _third(attempt) for name, (attempt, _) in FAULTS.items()}


@each("fault", FAULTS)
def test_the_harness_finds(fault):
    tally = knock(fault, 5, seed=0, targets="test_fuzz:faulty", limits=LIMITS)
    (finding,) = tally.findings
    assert finding.number == 2 and FAULTS[fault][1] in finding.wrong


def test_a_try_is_drawn_from_its_number_alone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # the harness leaves its folder for the one above
    from fuzzing.harness import _generator, tried

    drawn = []

    def attempt(samples, here, rng):
        drawn.append(rng.random())
        return lambda: 0

    for number in (3, 1, 3):
        tried(Target(attempt=attempt), tmp_path, tmp_path / "here", _generator("x", 0, number), lambda: "")
    assert drawn[0] == drawn[2] != drawn[1]
