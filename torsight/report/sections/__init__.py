"""Text and tables of the report.

In: the JSON results of a run. Out: sentences and rows for the page's template; empty where a result is absent.
"""
