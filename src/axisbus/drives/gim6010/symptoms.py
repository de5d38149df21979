"""The notes on a GIM6010-8 for the pages of symptoms, by the name of the page."""

from __future__ import annotations

from axisbus.cia301.tables import rows
from axisbus.symptoms.symptom import SymptomNote

NOTES = {
    row["page"]: SymptomNote("GIM6010-8", (row["check"],), (row["read_on"],))
    for row in rows(__package__, "symptoms.tsv")
}
