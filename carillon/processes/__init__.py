"""Processes, threads and ranks, and the libraries that start them."""
