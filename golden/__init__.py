"""Golden vectors, format 1: values that Python and Kotlin must both compute. format.md describes the files."""
