"""Golden vectors, format 1: what Python and Kotlin must both compute. README.md describes the files."""
