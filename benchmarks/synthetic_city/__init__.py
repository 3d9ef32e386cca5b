"""A synthetic city, drawn in arrays: stations, streets, walkers, shadowing by place."""
