"""Labs of a course: a file of checks with points, and the grades of planners by it.

checks      what is asked of a drive: each kind of check, and how it is measured
lab_file    a lab, read from a TOML file
recorded_commands drives a planner in a process of its own, which records its commands
grading     drives again by what was recorded, and grades planners
grades      the points of planners, and their tables
grade_page  the page of a planner
"""
