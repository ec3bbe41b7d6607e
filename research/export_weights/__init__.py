"""The shipped graph of `lift`: calibrated, its convolutions in 8 bits."""
