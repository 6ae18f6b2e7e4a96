"""What a release shows of itself: requirements, SOUP, SBOM; and what users get, kept. None of it ships."""
