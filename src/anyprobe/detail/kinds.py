"""Kinds of places that a panorama may show."""

INDOORS, OPEN_AIR = "indoors", "outdoors"
