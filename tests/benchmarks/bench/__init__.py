"""The benchmark: what a Newton iteration costs, and where, against other revisions of the package."""
