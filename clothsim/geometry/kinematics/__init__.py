"""Kinematics of triangulated cloth: deformation gradients, stretches, rotations, hinge angles, curvature, thickness."""
