"""Pictures of a run: what they show (`survey`, `picture`), and the printed ones (`plots`)."""
