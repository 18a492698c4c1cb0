"""A league of planners: every heat of a round robin, standings with ratings, and a page with every incident.

league         plans the heats, drives those that are missing, and writes the tables
heat           one heat: who starts where, and its result
incidents      the contacts of a heat, each with the poses of its cars around the touch
ratings        strengths by wins and losses (Bradley-Terry), with intervals
league_tables  standings, who beat whom, and points by track
league_page    the page, on which each incident can be replayed
"""
