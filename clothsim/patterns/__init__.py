"""Sewing patterns: panels of curved edges, their seams, and their meshes."""
