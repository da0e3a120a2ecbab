"""Validations of many solids, materials, seeds and ranks, judged together."""
