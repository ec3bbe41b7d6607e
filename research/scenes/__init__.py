"""Rendered photos by families (grounds of real maps, tables, dark studios, ...): to learn from, to choose models by."""
