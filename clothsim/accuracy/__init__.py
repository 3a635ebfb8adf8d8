"""Accuracy study: error of a scene's result, its sources, and the cost of a smaller one."""
