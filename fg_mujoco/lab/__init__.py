"""The friction lab: experiments that show how far the speed law and the tires hold, and the report of them.

    from fg_mujoco.lab.lab import run_lab

    run_lab(["skidpad", "braking"], out="runs/friction", workers=2)

Each experiment is a module here with an `EXPERIMENT`, which `experiment` defines: `skidpad`, `transient`, `braking`,
`mismatch`, `patches` and `laps`. `lab` runs them and keeps finished cells, and `lab_report` writes the report. The
others are closed forms (`rigid_car`, `straight_line_limits`, `lap_time_bound`) and grounds to drive on (`lab_ground`,
`lab_laps`). `manoeuvres`, `commands`, `drive` and `handling` are of the command `drive`.
docs/friction.md has the results.
"""
