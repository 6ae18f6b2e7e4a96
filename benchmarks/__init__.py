"""Commands that print tables: proofs, peers, speed. Each module's docstring says what it measures."""
