"""The network that proposes the object: its scenes, its training, its export."""
