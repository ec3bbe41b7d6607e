"""Training and evaluation of the networks of anyprobe."""
