"""Reproductions of published documents: their models and tables, apart from the product."""
