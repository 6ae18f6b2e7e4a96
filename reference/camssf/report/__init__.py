"""Renders a result document as a page, a picture, tables and a notebook view."""
