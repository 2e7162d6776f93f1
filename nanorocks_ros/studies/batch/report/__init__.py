"""The report of a batch: its sections, tables and figure."""
