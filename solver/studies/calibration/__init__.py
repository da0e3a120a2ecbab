"""Constants of the objective `calibrated`, chosen so that spectra of random solids come out right.

Fitting a block by itself leaves open how its neighbours hold it and how stiff the coarse mesh is
between its nodes. Both show in spectra, and a frequency's derivative with respect to a modulus is
the share of strain energy at that quadrature point. So Gauss-Newton over many random solids finds
the constants of `dataset_gen.objectives.calibration` in a few steps. The solids are none of those
that the objectives are judged on.
"""
