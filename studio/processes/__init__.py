"""Processes that compute for the studio, and what they do."""
