"""Rendered photos by families (rooms, grounds of real maps, dark studios, ...), to learn from and to choose models by."""
