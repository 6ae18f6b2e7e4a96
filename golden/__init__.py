"""Golden vectors, format 1: values that Python and Kotlin must both compute. README.md describes the files."""
