"""The content of the report's page as plain data for the templates in data/report, one file per section."""
