"""Keys of a scene: every section, effect, generator and fabric declared once."""
