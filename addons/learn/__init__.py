"""Learning: trainings, and policies from files as planners. Needs the extra `train`, or `policies` to drive only.

`training` trains with Stable-Baselines3, `residual` corrects a planner, `policy_files` reads policies, and
`policy_planner` drives by them.
"""
