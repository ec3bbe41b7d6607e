"""How well objects are found in photos: IoU with true masks, and whether bad masks come with a warning."""
