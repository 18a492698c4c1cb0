"""The friction lab: up to where a speed law is safe on a car, and why not beyond.

`skidpad`, `step`, `braking` and `laps` have the experiments, which `experiment` defines; `lab` runs them and keeps
finished cells. `speed_laws` has the laws, `limits` and `lap_time_bound` the closed forms. `manoeuvres`, `commands`,
`drive` and `handling` are of the command `drive`. docs/friction.md has the results.
"""
