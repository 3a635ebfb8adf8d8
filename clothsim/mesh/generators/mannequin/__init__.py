"""A procedural mannequin: capsules round a skeleton, their smooth union meshed once, figures and poses by skinning."""
