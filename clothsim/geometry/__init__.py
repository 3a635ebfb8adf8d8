"""Geometry of surfaces: kinematics of shells, exact intersections, untangling."""
