"""Designs for other tools: embedded mesh with eigenpairs, glTF, Faust."""
