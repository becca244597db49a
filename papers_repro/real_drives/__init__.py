"""The papers' methods on real recordings: what they are worth beyond their own experiments."""
