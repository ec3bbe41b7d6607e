"""The light network: one lean network that says everything about the light of one photo, learned from train.world."""
