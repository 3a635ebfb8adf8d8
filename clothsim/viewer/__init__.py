"""Page of a run in a browser, served on this machine."""
