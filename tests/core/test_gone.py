"""What went is refused in a line that says what serves instead."""

from cases import each
from fg_mujoco.gone import GONE
from refusals import refused


@each("given", [given for given in GONE if " " in given])
def test_what_went_is_refused_with_what_serves_instead(given, here, capsys):
    setting, words = given.removeprefix("setting "), given.removeprefix("fg-mujoco ").split()
    words = words if setting == given else ("race", "--controller", f"gap_finder[{setting}=1]")
    assert f"{given!r} is gone; instead: {GONE[given]}" in refused(here, capsys, *words)
