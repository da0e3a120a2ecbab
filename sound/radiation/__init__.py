"""Sound that the surfaces of vibrating solids radiate into the air."""
