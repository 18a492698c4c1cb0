"""Maps and runs from bags: `poses` says where the LiDAR was at each scan, and `mapped_run` makes a run folder of a bag.

The map itself is made by fg_mujoco.addons.realcar.mapping.
"""
