#!/usr/bin/env bash
# Mass and inertia that a spec tells a body explicitly are compiled, and left out when the spec is written as XML.
#
# Guess: with `explicitinertial` the text that `to_xml` writes has an <inertial>, so that it compiles to the same body.
# Seen, mujoco 3.17.0 and 4.0.0: the body weighs the 2 kg that it was told, and 8 kg, those of its box, once it is written
# and read. With `ipos`, even zeros, the <inertial> is written. A body without geoms was google-deepmind/mujoco#2370.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/inertia.py" <<'PYTHON'
import sys

import mujoco


def masses(**told):
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(mass=2.0, inertia=[0.1, 0.2, 0.25], explicitinertial=True, **told)
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1])
    compiled = spec.compile()
    read = mujoco.MjModel.from_xml_string(spec.to_xml())
    return round(float(compiled.body_mass[1]), 6), round(float(read.body_mass[1]), 6)


plain, placed = masses(), masses(ipos=[0.0, 0.0, 0.0])
print(f"mujoco {mujoco.__version__}: compiled and read again {plain}; with ipos {placed}")
sys.exit((plain, placed) != ((2.0, 8.0), (2.0, 2.0)))
PYTHON
for version in 3.17.0 4.0.0; do
    python3 -m venv "$folder/$version"  # of its own: 4.0.0 over 3.17.0 cannot be imported
    "$folder/$version/bin/pip" install --quiet --disable-pip-version-check "mujoco==$version"
    "$folder/$version/bin/python" "$folder/inertia.py"
done
