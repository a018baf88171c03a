"""The report of a campaign: tables, figures, averaged curves, findings, one page."""
