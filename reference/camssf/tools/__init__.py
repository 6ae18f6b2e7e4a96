"""Commands that make what the package ships: bases and tables."""
