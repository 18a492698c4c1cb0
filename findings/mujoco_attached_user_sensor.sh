#!/usr/bin/env bash
# A user sensor without an object, in a spec that is attached with a prefix, is written as XML that MuJoCo cannot read.
#
# Guess: `parent.attach(child, prefix="car/")` leaves an empty `objname` empty, so that `to_xml` of the parent reads back as
# that of the child does.
# Seen, mujoco 3.17.0 and 4.0.0: the model compiles, but the prefix alone becomes the name of an object, `objname="car/"`,
# without an `objtype`. Reading the text is a ValueError: "attributes 'objtype', 'objname' must be specified together".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/attached.py" <<'PYTHON'
import sys

import mujoco

child = mujoco.MjSpec.from_string("""
<mujoco>
  <worldbody><body><joint name="turn"/><geom size=".1"/></body></worldbody>
  <sensor><user name="own" dim="3" needstage="vel"/></sensor>
</mujoco>""")
alone = mujoco.MjSpec.from_string(child.to_xml()).compile().nsensor
parent = mujoco.MjSpec()
parent.attach(child, prefix="car/", frame=parent.worldbody.add_frame())
compiled, text = parent.compile().nsensor, parent.to_xml()
try:
    mujoco.MjSpec.from_string(text)
    reading = "read"
except ValueError as error:
    reading = str(error).splitlines()[0]
named = 'objname="car/"' in text
print(f"mujoco {mujoco.__version__}: alone {alone}, compiled {compiled}, named after the prefix: {named}; {reading}")
seen = (alone, compiled) == (1, 1) and named and "must be specified together" in reading
sys.exit(not seen)
PYTHON
for version in 3.17.0 4.0.0; do
    python3 -m venv "$folder/$version"  # of its own: 4.0.0 over 3.17.0 cannot be imported
    "$folder/$version/bin/pip" install --quiet --disable-pip-version-check "mujoco==$version"
    "$folder/$version/bin/python" "$folder/attached.py"
done
