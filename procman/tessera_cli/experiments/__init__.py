"""Measurements, one module for each experiment, and what they share: checkouts, runs, tables and a page."""
