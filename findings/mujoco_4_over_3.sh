#!/usr/bin/env bash
# `pip install mujoco==4.0.0` in an environment that has mujoco 3.17.0 leaves a MuJoCo that cannot be imported.
#
# Guess: pip replaces one version by the other, as for other packages.
# Seen, pip 23.2.1: since 4.0.0 the compiled files are in a package of their own, mujoco-core, with the same
# paths. pip installs it first, and then removes the files of mujoco 3.17.0, which are the same files. The import is an
# ImportError that names the repair; installing mujoco-core once more mends it. In an empty environment 4.0.0 works.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
pip() { "$folder/venv/bin/pip" install --quiet --disable-pip-version-check "$@"; }
imported() { "$folder/venv/bin/python" -c 'import mujoco; print("imported", mujoco.__version__)' 2>&1 | tail -n 3 || true; }
"$folder/venv/bin/pip" --version | cut -d' ' -f1-2
pip mujoco==3.17.0
imported | tee "$folder/before"
pip mujoco==4.0.0
imported | tee "$folder/upgraded"
pip --force-reinstall --no-deps mujoco-core==4.0.0
imported | tee "$folder/mended"
grep -q 'imported 3.17.0' "$folder/before"
grep -q 'ImportError' "$folder/upgraded"
grep -q 'imported 4.0.0' "$folder/mended"
