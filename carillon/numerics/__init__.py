"""Small products and sums on the registers of the processor."""
