"""What went is refused in a line that says what serves instead."""

from cases import each
from fg_mujoco.gone import GONE
from refusals import refused


@each("given", [given for given in GONE if " " in given])
def test_a_command_or_an_option_that_went_is_refused_with_what_serves_instead(given, here, capsys):
    words = given.removeprefix("fg-mujoco ").split()
    assert f"{given!r} is gone; instead: {GONE[given]}" in refused(here, capsys, *words)
