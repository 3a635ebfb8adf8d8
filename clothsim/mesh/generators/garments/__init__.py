"""Garments cut out of offset surfaces of the mannequin: they fit it in its rest pose, with a given ease."""
