"""What a release shows of itself: the trace of its requirements, its SOUP sheet, its SBOM. None of it ships."""
