"""The shipped graph of `lift`: calibrated."""
