"""US 2006/0293826: apparatus and method for measuring speed of a moving object, with the roll angle."""
