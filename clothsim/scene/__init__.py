"""Floor 7: a scene is data; the table of effects turns its names into energies."""
