"""Write the pages of reference into docs/reference, where git ignores them.

Usage: python -m references OPENAPI.json
"""

import json
import sys
from pathlib import Path

from references import grpc_pages, http_pages, python_page

REPOSITORY = Path(__file__).resolve().parents[3]


def main() -> None:
    """Write all pages."""
    openapi = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    pages = {
        **grpc_pages.pages(REPOSITORY / "proto"),
        **http_pages.pages(openapi),
        "python.md": python_page.page(REPOSITORY / "client" / "python"),
    }
    for name, text in pages.items():
        path = REPOSITORY / "docs" / "reference" / name
        # An unchanged page need not be read again by Sphinx.
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(exist_ok=True)
            path.write_text(text, encoding="utf-8")


main()
