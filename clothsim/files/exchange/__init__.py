"""Writers of a run's frames for other programs: a module a format, and the table of formats."""
