"""Learns a basis from measured cameras or from results of calibrations."""
