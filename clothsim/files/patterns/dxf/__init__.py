"""Sewing patterns as DXF drawings of AAMA and ASTM."""
