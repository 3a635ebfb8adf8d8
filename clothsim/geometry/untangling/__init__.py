"""Untangling of intersecting surfaces: contours, the regions that they bound, and motions that shrink them."""
