"""Photos of a chart by a simulated camera, with their truth and their faults."""
