"""Labs of a course: a file of checks with points, and the grades of planners by it.

checks      what is asked of a drive: each kind of check, and how it is measured
lab_file    a lab, read from a TOML file
grading     drives the planners of students, and grades them
grades      the points of planners, and their tables
grade_page  the page of a planner
"""
