"""Two result documents of the same photos, compared stage by stage."""
