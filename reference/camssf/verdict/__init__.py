"""Judges an answer: accepted, doubtful or refused, with reasons."""
