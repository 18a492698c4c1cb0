"""Recorded drives: what a car measured and was commanded, read from CSV files, bags and run folders alike."""
