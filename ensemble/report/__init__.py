"""The report of a campaign: tables, figures, averaged curves, findings, one page.

Import :func:`adhesis.ensemble.report.write_report.write_report`; everything is made from an
aggregate alone.
"""
