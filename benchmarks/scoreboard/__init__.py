"""The accuracy scoreboard: worlds to walk in, estimators to compare, and what they reach."""
