"""Identification of tires and steering from recorded drives; the method: docs/addons/realcar/identification.md."""
