"""Results for people: reports, figures, tables and sentences."""
