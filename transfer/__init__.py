"""Fits a garment made for one body onto another: arrays in, arrays out.

The room is kept for deformation transfer (Sumner & Popovic 2004) and DRAPE refinement (Guan et al. 2012).
It imports nothing of clothsim.
"""
