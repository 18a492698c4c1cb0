"""Hostile input: the targets through which files and values of others come in, and a harness that tries them.

python -m fuzzing --tries 1000 [--target NAME] [--seed N], in the folder tests, is the long form
of tests/core/test_fuzz.py.
"""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "worlds"))  # what tests build, for the long form
