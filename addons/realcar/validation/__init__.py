"""Validation: the recorded commands of a real car driven from its recorded states, by our cars."""
