"""Identities of the whole run: multiple hypotheses of which rows belong to one person."""
