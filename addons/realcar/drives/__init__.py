"""Recorded drives: what a car measured and was commanded, read from CSV files, bags and run folders alike.

    drive = read_drive("drive.csv")
    print(drive.checks)
    drive.rows.speed, drive.rows.yaw_rate

`channels` has what one sensor measured, `recorded` a drive of them. `drive_columns` says which column of a CSV file is
what, `drive_csv` reads it, `wrong_units` recognises degrees and the like, `drive_checks` compares the sensors with each
other, `driven_runs` makes the drive of a run folder, and `reading` reads any drive.
"""
