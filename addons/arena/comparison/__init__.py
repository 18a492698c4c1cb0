"""Comparison of planners: each on every course, at every speed, with every seed.

comparison   plans the runs, drives those that are missing, and writes the report
run, ground  one run, and the course and obstacles that it is driven on
store        the folder of a comparison, from which a later call goes on
tables, pictures, pages     the report: CSV and Markdown, PNG, HTML
"""
