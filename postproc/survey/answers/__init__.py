"""What a survey is asked: a baseline for loggers, changes, a map, and where to walk next."""
