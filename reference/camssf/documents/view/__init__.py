"""What the report's page shows, as plain data: one file a part of it, for the templates of data/report."""
