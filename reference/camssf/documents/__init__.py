"""Products as plain data and as pages: patches, result, report."""
