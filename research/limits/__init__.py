"""A model's figures by kind of material and alpha, beside more given inputs and what a perfect sphere allows."""
