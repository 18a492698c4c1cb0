#!/usr/bin/env bash
# MuJoCo's compiler flag `discardvisual` changes when bodies fall asleep, and so how they move.
#
# Guess: a geom that collides with nothing, on a body whose inertia is given, is only seen; the documentation says that
# what the flag discards has no effect on the physics. So both models move alike, with the flag `sleep`, too.
# Seen, mujoco 3.17.0 and 4.0.0: dof_length, by which a rate of turning is compared with sleep_tolerance, is computed
# with such geoms. A body that turns at .005 rad/s goes on with a bar of 2 m that is only seen, and is stopped for good
# after ten steps without it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/discardvisual.py" <<'PYTHON'
import sys

import mujoco

MODEL = """
<mujoco>
  <compiler discardvisual="{discards}"/>
  <option gravity="0 0 0"><flag sleep="enable"/></option>
  <worldbody>
    <body>
      <freejoint/>
      <inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/>
      <geom size=".02"/>
      <geom type="box" size="1 .01 .01" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>"""


def rate_after(steps, discards):
    model = mujoco.MjModel.from_xml_string(MODEL.format(discards=discards))
    data = mujoco.MjData(model)
    data.qvel[5] = 0.005
    for _ in range(steps):
        mujoco.mj_step(model, data)
    return model.ngeom, round(model.dof_length[5], 2), data.qvel[5]


seen = [rate_after(100, "false"), rate_after(100, "true")]
print(f"mujoco {mujoco.__version__}: geoms, dof_length and rate {seen}")
sys.exit(seen != [(2, 1.0, 0.005), (1, 0.02, 0.0)])
PYTHON
for version in 3.17.0 4.0.0; do
    python3 -m venv "$folder/$version"  # of its own: 4.0.0 over 3.17.0 cannot be imported
    "$folder/$version/bin/pip" install --quiet --disable-pip-version-check "mujoco==$version"
    "$folder/$version/bin/python" "$folder/discardvisual.py"
done
