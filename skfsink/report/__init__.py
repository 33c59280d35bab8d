"""The report: one page of HTML, without scripts and with all pictures inside, of one run or of several compared."""

from .page import report_page, write_report

__all__ = ["report_page", "write_report"]
