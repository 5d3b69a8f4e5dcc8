"""The types of this package, as `.ljs` files."""
