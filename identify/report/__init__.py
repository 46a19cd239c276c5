"""The report: figures, the HTML page."""
