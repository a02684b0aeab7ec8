#!/usr/bin/env python3
"""Follows the links of all pages of the project: files exist, and so do headings that are named.

    python3 tests/test_links.py
"""

import pathlib
import re
import sys

PROJECT = pathlib.Path(__file__).resolve().parent.parent
LINK = re.compile(r"\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ +(.*)$", re.MULTILINE)
CODE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)


def anchors(page):
    """The names that GitHub gives to headings."""
    headings = HEADING.findall(CODE.sub("", page.read_text(encoding="utf-8")))
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}


def faults(page):
    for link in LINK.findall(CODE.sub("", page.read_text(encoding="utf-8"))):
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if "://" in link:
            continue
        if not target.exists():
            yield f"{link} leads nowhere"
        elif anchor and anchor not in anchors(target):
            yield f"{link}: no such heading"


pages = [p for p in sorted(PROJECT.rglob("*.md")) if not re.match(r"(build|out)", p.relative_to(PROJECT).parts[0])]
found = [f"{page.relative_to(PROJECT)}: {fault}" for page in pages for fault in faults(page)]
print("\n".join(found) or f"links of {len(pages)} pages: all lead somewhere")
sys.exit(1 if found else 0)
