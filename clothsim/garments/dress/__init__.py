"""Dressing: sewing patterns closed round a body, welded and draped."""
