"""A study of planners: a suite, driven run by run into a folder, and the tables and pages of it.

suite       what is driven, as a file has it: courses, conditions, heats, opponents, checks
plan        the runs of a suite with some planners; what cannot be driven is refused there
store       the folder, and what drives the runs that are missing there
tables      groups of runs, and what is said of each; `intervals` and `ratings`: how sure that is
kinds       studies of planners alone, of heats, of duels, of checks, each with its tables
functions   study, compare, overtake, league
pages, league_page, grade_page, pictures    for people
"""
