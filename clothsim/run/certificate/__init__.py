"""Certificate of a run: intersections, residuals, energies and errors."""
