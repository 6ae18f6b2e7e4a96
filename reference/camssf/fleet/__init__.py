"""Many cameras: manifest in, one result each."""
