"""A study of planners: a suite, driven run by run into a folder, and the one table of it.

suite       what is driven, as a file has it: courses, conditions, opponents, duels, checks
plan        the runs of a suite with some planners; what cannot be driven is refused there
store       the folder, and what drives the runs that are missing there
tables      the table: groups of runs, and what is said of each
page        the table as a page, with where planners drove
functions   study, and compare, which makes a suite of lists
"""
