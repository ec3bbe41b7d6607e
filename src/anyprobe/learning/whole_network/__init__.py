"""What the network that is given the whole photo makes of whole photos, before it is exported."""
