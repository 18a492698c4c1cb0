"""The friction lab: experiments that show how far the speed law and the tires hold, and the report of them.

    from fg_mujoco.studies.friction_lab.lab import run_lab

    run_lab(["skidpad", "braking"], out="runs/friction", workers=2)

Each experiment is a module here with an `EXPERIMENT`; `experiment.py` says what that is. docs/friction.md says what
the lab shows and how to read it.
"""
