"""Garments cut out of a surface round the mannequin: they fit it in its rest pose, with a given ease."""
