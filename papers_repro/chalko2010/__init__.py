"""Chalko 2010: the equations audited, the method tested on exact motions and real drives, its question answered."""
