"""How the solver scales over ranks: measured where there are cores, modelled beyond."""
