"""Tools that write data files and release documents (requirements, SOUP, SBOM) or compare outputs; not shipped."""
