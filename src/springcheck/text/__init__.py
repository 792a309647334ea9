"""Words, lines and tables of reports, messages and pages."""
