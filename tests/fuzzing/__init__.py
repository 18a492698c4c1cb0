"""Hostile input: the doors through which files and values of others come in, and a harness that tries them.

python -m fuzzing --tries 1000 [--door NAME] [--seed N], in the folder tests, is the long form of tests/test_fuzz.py.
"""
