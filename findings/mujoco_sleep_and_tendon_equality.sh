#!/usr/bin/env bash
# With MuJoCo's flag `sleep`, an equality of two tendons stops every simulation, also where no body may sleep.
#
# Guess: bodies with sleep="never" do not care for the flag, as an equality of two joints does not.
# Seen, mujoco 3.17.0 and 4.0.0: mj_forward raises FatalError, "tendon equality does not yet support sleeping", whatever
# the bodies say; without the flag, and with an equality of joints, the same model runs.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/sleep.py" <<'PYTHON'
import sys

import mujoco

MODEL = """
<mujoco>
  <option><flag sleep="{flag}"/></option>
  <worldbody>
    <body sleep="never"><joint name="a"/><geom size=".1"/></body>
    <body pos="1 0 0" sleep="never"><joint name="b"/><geom size=".1"/></body>
  </worldbody>
  <tendon><fixed name="t"><joint joint="a" coef="1"/><joint joint="b" coef="-1"/></fixed></tendon>
  <equality>{equality}</equality>
</mujoco>"""
TENDON, JOINT = '<tendon tendon1="t"/>', '<joint joint1="a" joint2="b"/>'


def runs(flag, equality):
    model = mujoco.MjModel.from_xml_string(MODEL.format(flag=flag, equality=equality))
    try:
        mujoco.mj_forward(model, mujoco.MjData(model))
    except mujoco.FatalError as error:
        return str(error)
    return "runs"


seen = [runs("disable", TENDON), runs("enable", JOINT), runs("enable", TENDON)]
print(f"mujoco {mujoco.__version__}: {seen}")
sys.exit(seen[:2] != ["runs", "runs"] or "does not yet support sleeping" not in seen[2])
PYTHON
for version in 3.17.0 4.0.0; do
    python3 -m venv "$folder/$version"  # of its own: 4.0.0 over 3.17.0 cannot be imported
    "$folder/$version/bin/pip" install --quiet --disable-pip-version-check "mujoco==$version"
    "$folder/$version/bin/python" "$folder/sleep.py"
done
