"""What went is refused in a line that says what serves instead."""

from cases import each
from fg_mujoco.gone import GONE
from refusals import refused


@each("given", GONE)
def test_what_went_is_refused_with_what_serves_instead(given, here, capsys):
    assert f"{given!r} is gone; instead: {GONE[given]}" in refused(here, capsys, *given.split())
