"""What speaks for an answer, and against it: scores, surprise, verdict."""
