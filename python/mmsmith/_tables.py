"""Rows of cells as text and as HTML; the first row is the head."""

from collections.abc import Sequence

Rows = Sequence[Sequence[str]]


def as_text(rows: Rows) -> str:
    """Columns of one width each."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows)


def as_html(rows: Rows) -> str:
    """A table for notebooks."""
    lines = ("".join(f"<{'td' if n else 'th'}>{cell}</{'td' if n else 'th'}>" for cell in row) for n, row in enumerate(rows))
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"


def as_markdown(rows: Rows) -> str:
    """A table for pages and comments."""
    head, *rest = (f"| {' | '.join(row)} |" for row in rows)
    return "\n".join([head, "|---" * len(rows[0]) + "|", *rest])
