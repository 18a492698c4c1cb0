"""Identification: the tires and the steering of a car, from a drive that it recorded.

    found = identify_drives([Drive.of_run(read_run("runs/slalom"))])
    print(found)

`drive_log` has what a car records, `smoothed_motion` smooths it, `steering_response` has the wheels follow the
commands, `fit` finds the parameters of `single_track`, `identification` measures them on the part held back,
`tire_file` writes them as TOML, and `page` draws it. The method and its accuracy:
docs/addons/realcar/identification.md.
"""
