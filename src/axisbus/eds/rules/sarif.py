"""Findings as SARIF 2.1.0 (OASIS), the format in which code hosts read the findings of checkers and show them in a diff."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from axisbus.eds.model import EdsFinding, Severity
from axisbus.eds.rules.table import Rule, rules

SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
_ROOT = "%SRCROOT%"
_LEVELS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.NOTE: "note"}


def log(
    found: Mapping[str, Iterable[EdsFinding]],
    version: str,
    root: Path,
    command: str = "axisbus eds check",
    known: Mapping[str, Rule] | None = None,
) -> dict[str, Any]:
    """Return a SARIF log of the findings by file; files below ``root`` get a URI relative to it.

    ``version`` is that of axisbus, ``command`` is the checker, and ``known`` are its rules (None: those of EDS files). The log
    contains all rules with their texts, even those without findings.
    """
    known = rules() if known is None else known
    driver = {
        "name": command,
        "semanticVersion": version,
        "rules": [_rule(rule) for rule in known.values()],
    }
    numbers = {rule: number for number, rule in enumerate(known)}
    results = [
        _result(finding, numbers[finding.rule], _artifact(file, root))
        for file, findings in found.items()
        for finding in findings
    ]
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "originalUriBaseIds": {_ROOT: {"description": {"text": "the folder in which the check was started"}}},
        "artifacts": [{"location": _artifact(file, root)} for file in found],
        "results": results,
    }
    return {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}


def _rule(rule: Rule) -> dict[str, Any]:
    where = f" ({rule.clause})" if rule.clause else ""
    remedy = rule.remedy[0].upper() + rule.remedy[1:]
    return {
        "id": rule.id,
        "shortDescription": {"text": rule.title},
        "fullDescription": {"text": rule.explanation},
        "help": {
            "text": f"{rule.title}{where}\n\n{rule.explanation}\n\n{remedy}.",
            "markdown": f"**{rule.title}**{where}\n\n{rule.explanation}\n\n*{remedy}.*",
        },
        "defaultConfiguration": {"level": _LEVELS[rule.severity]},
    }


def _result(finding: EdsFinding, number: int, artifact: dict[str, str]) -> dict[str, Any]:
    region = {"startLine": max(1, finding.line), "startColumn": max(1, finding.column)}
    location: dict[str, Any] = {"physicalLocation": {"artifactLocation": artifact, "region": region}}
    if finding.index is not None:
        location["logicalLocations"] = [{"fullyQualifiedName": _object(finding), "kind": "object"}]
    return {
        "ruleId": finding.rule,
        "ruleIndex": number,
        "level": _LEVELS[finding.severity],
        "message": {"text": f"{finding.message}. To do: {finding.remedy}."},
        "locations": [location],
    }


def _object(finding: EdsFinding) -> str:
    sub = "" if finding.subindex is None else f"sub{finding.subindex:X}"
    return f"{finding.index:04X}{sub}"


def _artifact(file: str, root: Path) -> dict[str, str]:
    path = Path(file).absolute()
    if path.is_relative_to(root):
        return {"uri": quote(path.relative_to(root).as_posix()), "uriBaseId": _ROOT}
    return {"uri": path.as_uri()}
