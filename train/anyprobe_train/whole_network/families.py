"""Families of rendered photos, by the numbers that files of pairs hold."""

FAMILIES = ("ground", "table", "things", "dark", "procedural")
