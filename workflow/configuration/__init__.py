"""The configuration of a run as models: what a key means, its unit, bounds and default.

The sections of a study, and the memory and time of its rules, are in `config.py` in its folder.
"""
