"""How near a spectrum is to the solid's, and cells divided until it is near enough."""
