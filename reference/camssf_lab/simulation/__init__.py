"""Simulates photos of a chart, with their true values and with faults."""
