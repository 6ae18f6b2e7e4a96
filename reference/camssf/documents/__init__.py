"""Products as JSON documents: patches, results, passports and revocation lists."""
