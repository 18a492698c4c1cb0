"""How the command line refuses what it cannot use."""

from fg_mujoco.cli.main import main


def contents(folder):
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def refused(here, capsys, *arguments):
    """Assert exit 2, one line on stderr, nothing on stdout, nothing written in a folder; return the line."""
    before = contents(here)
    try:
        code = main(arguments)
    except SystemExit as end:  # argparse leaves like that
        code = end.code
    out, err = capsys.readouterr()
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("fg-mujoco")
    assert "Traceback" not in err
    assert contents(here) == before
    return err
