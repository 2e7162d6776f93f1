"""The whole plate with its eight trays, as the flight camera sees it."""
