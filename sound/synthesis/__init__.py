"""Modal synthesis: samples of damped sinusoids, by themselves, struck, or driven by forces."""
