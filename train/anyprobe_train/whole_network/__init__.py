"""Training and export of WholeNet, the network that sees the whole photo."""
