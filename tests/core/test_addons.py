"""The core drives without add-ons, and one that cannot be imported names itself and leaves the core working."""

import ast
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from cases import each
from fg_mujoco import from_addons
from fg_mujoco.errors import MissingExtraError
from fg_mujoco.from_addons import PLACES
from fg_mujoco.registry import ADDONS, added, imported

TABLES = ("COMMANDS", "NAMES", "PLANNERS", "SCENES", "SCHEMES")


def run(code):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


def test_the_core_races_and_shows_its_help_without_add_ons():
    said = run(
        "import sys\nsys.modules['fg_mujoco.addons'] = None\n"
        "import fg_mujoco as fg\nfrom fg_mujoco.cli.main import main\n"
        "print(fg.race('oval', laps=1, time_limit=0.5).car.end_reason)\n"
        "try:\n    main(['--help'])\nexcept SystemExit as end:\n    print(end.code)\n"
        "try:\n    main(['race', '--help'])\nexcept SystemExit as end:\n    print('help', end.code)\n"
        "print(main(['race', '--floor', 'ipz8', '--time-limit', '0.1']))\n"
        "print(fg.race('oval', laps=1, time_limit=0.1)._repr_html_())"
    )
    assert "time_limit" in said and "rollout" in said and "overtake" not in said
    assert "--floor" in said and "help 0" in said and "None" in said
    assert "2\n" in said and "'Floor' is of an add-on, and no add-ons are installed" in said


def test_an_add_on_that_cannot_be_imported_names_itself():
    said = run(
        "import sys\nsys.modules['fg_mujoco.addons.arena'] = None\n"
        "from fg_mujoco.cli.main import main\nprint(main(['compare']), main(['vehicles', 'f1tenth']))"
    )
    assert "2 0" in said
    assert "'compare' is of the add-on arena, which cannot be imported: ModuleNotFoundError" in said


def test_a_race_is_told_and_written_where_the_page_cannot_be_made(tmp_path):
    said = run(
        "import sys\nsys.modules['fg_mujoco.addons.look'] = None\n"
        "from fg_mujoco.cli.main import main\n"
        f"print(main(['race', '--laps', '1', '--time-limit', '0.5', '--out', {str(tmp_path / 'run')!r}]))"
    )
    assert "time limit" in said and "'report_race' is of the add-on look, which cannot be imported" in said
    assert "\n1\n" in said  # it was not driven to its end, and nothing worse
    assert (tmp_path / "run" / "summary.json").exists()


@each("table", TABLES)
def test_what_the_tables_name_is_there(table):
    for name, place in added(table).items():
        with suppress(MissingExtraError):
            imported(place, name)


def test_what_the_core_asks_add_ons_for_is_what_mypy_and_import_linter_see():
    tree = ast.parse(Path(from_addons.__file__).read_text("utf-8"))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and ADDONS in (node.module or "")]
    checked = {f"{node.module}:{alias.asname}" for node in imports for alias in node.names}
    assert checked == {f"{ADDONS}.{place}:{name}" for place, names in PLACES.items() for name in names.split()}
